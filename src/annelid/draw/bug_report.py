"""What a bug report should say of a machine, as Markdown without names of users, machines or folders."""

from __future__ import annotations

import getpass
import os
import platform
import re
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import annelid
from annelid.draw.doctor import Finding

BACK_ENDS = ("egl", "osmesa", "glfw", "wgl", "cgl")
"""Values of MUJOCO_GL that may be told."""

_PATH = re.compile(r"(?:(?<!\w)[A-Za-z]:|(?<!\w))(?:[/\\]+[^\s/\\'\":;,()]+)+[/\\]*")


def bug_report(findings: Sequence[Finding]) -> str:
    """Returns the report.

    Args:
        findings: What `annelid.draw.doctor.examine` found.
    """
    facts = {
        "annelid": " ".join(filter(None, (_version("annelid"), _commit()))),
        "mujoco-core": _version("mujoco-core"),
        "Python": f"{platform.python_version()} ({platform.python_implementation()})",
        "system": f"{platform.system()} {platform.release()} {platform.machine()} {' '.join(platform.libc_ver())}",
        "processor": f"{_processor()}, {os.cpu_count()} logical cores",
        "MUJOCO_GL": _back_end(os.environ.get("MUJOCO_GL")),
    }
    lines = [f"- {name}: {without_names(value).strip()}" for name, value in facts.items()]
    rows = [f"| {each.item} | {each.state} | {without_names(each.detail)} |" for each in findings]
    return "\n".join([*lines, "", "| item | state | detail |", "|---|---|---|", *rows])


def without_names(text: str) -> str:
    """Returns a text in which paths are cut down to their last part, and the user and the machine are not named."""
    text = text.replace(str(Path.home()), "/HOME") if len(Path.home().parts) > 1 else text
    text = _PATH.sub(lambda path: "../" + re.split(r"[/\\]", path[0].rstrip("/\\"))[-1], text)
    for name, instead in ((_user(), "USER"), (platform.node(), "MACHINE"), (platform.node().split(".")[0], "MACHINE")):
        if name:
            text = re.sub(rf"(?<!\w){re.escape(name)}(?!\w)", instead, text)
    return " ".join(text.replace("|", "/").split())


def _version(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "not installed"


def _user() -> str:
    # A user without a name, as in some containers, needs none hidden.
    with suppress(OSError, KeyError, ImportError):
        return getpass.getuser()
    return ""


def _back_end(value: str | None) -> str:
    if not value:
        return "not set"
    return value if value in BACK_ENDS else "set to something else than a back-end"


def _processor() -> str:
    """The model of the processor, as the system calls it."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    if platform.system() == "Darwin":
        with suppress(OSError, subprocess.SubprocessError):
            return _answer("sysctl", "-n", "machdep.cpu.brand_string")
    return platform.processor() or "unknown processor"


def _commit() -> str:
    """The commit of the checkout that annelid is imported from, and whether files differ from it; empty elsewhere."""
    root = Path(annelid.__file__).parents[2]
    if not (root / ".git").exists():
        return ""
    with suppress(OSError, subprocess.SubprocessError):
        commit = _answer("git", "-C", str(root), "rev-parse", "--short=12", "HEAD")
        changed = _answer("git", "-C", str(root), "status", "--porcelain", "--untracked-files=no")
        return f"(commit {commit}{', modified' if changed else ''})"
    return ""


def _answer(*command: str) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
