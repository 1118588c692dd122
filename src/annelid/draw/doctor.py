"""What a run and its pictures need, whether it is there, and the line that installs it; as a bug report, too.

The report is Markdown that names no user, no machine and no folder.
"""

from __future__ import annotations

import getpass
import os
import platform
import re
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.util import find_spec
from pathlib import Path

from annelid.draw.gl import UNSET, candidates, find_backend, works
from annelid.engine import REMEDY, mixed_engine
from annelid.errors import RenderingUnavailable

MINIMUM_MUJOCO = (4, 0, 1)
_PACKAGES = ("numpy", "pydantic", "xarray", "h5netcdf", "h5py", "matplotlib", "imageio", "typer", "rich")
_DEVELOPERS_EXTRAS = ("test", "dev")
BACK_ENDS = ("egl", "osmesa", "glfw", "wgl", "cgl")  # values of MUJOCO_GL that a bug report may name
_PATH = re.compile(r"(?:(?<!\w)[A-Za-z]:|(?<!\w))(?:[/\\]+[^\s/\\'\":;,()]+)+[/\\]*")


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at."""

    item: str
    ok: bool  # whether it is there and works
    detail: str = ""  # its version, or what is wrong
    remedy: str = ""  # what to type where it is missing
    optional: bool = False  # whether annelid runs without it

    @property
    def state(self) -> str:
        """In one word: ok, optional or missing."""
        return "ok" if self.ok else "optional" if self.optional else "missing"

    def line(self) -> str:
        """Returns the finding as one line of text."""
        remedy = f": {self.remedy}" if self.remedy and not self.ok else ""
        return f"{self.state:<9}{self.item:<22}{self.detail}{remedy}".rstrip()


def examine() -> Iterator[Finding]:
    """Looks at Python, the engine, the packages, the OpenGL back-ends, ffmpeg and the extras, one at a time."""
    yield Finding("annelid", True, version("annelid"))
    yield Finding("python", True, f"{platform.python_version()} on {platform.system()} {platform.machine()}")
    yield _engine()
    yield from (_package(package, f"pip install {package}") for package in _PACKAGES)
    yield from _back_ends()
    yield _ffmpeg()
    for package, extra in _optional_packages().items():
        yield _package(package, f"pip install 'annelid[{extra}]'", optional=True)


def _engine() -> Finding:
    remedy = "pip install 'mujoco-core[rendering]>=4.0.1'"
    if mixed := mixed_engine():
        return Finding("mujoco", False, mixed, REMEDY)
    try:
        import mujoco
    except Exception as error:  # A back-end that MUJOCO_GL names fails in as many ways as there are libraries.
        remedy = remedy if isinstance(error, ImportError) else UNSET
        return Finding("mujoco", False, str(error).splitlines()[0], remedy)
    found = tuple(int(part) for part in mujoco.__version__.split(".")[:3] if part.isdigit())
    if found < MINIMUM_MUJOCO:
        return Finding("mujoco", False, f"{mujoco.__version__} is too old", remedy)
    return Finding("mujoco", True, mujoco.__version__)


def _package(name: str, remedy: str, *, optional: bool = False) -> Finding:
    try:
        return Finding(name, True, version(name), optional=optional)
    except PackageNotFoundError:
        return Finding(name, False, "not installed", remedy, optional)


def _back_ends() -> Iterator[Finding]:
    try:
        tried = candidates()
    except RenderingUnavailable as error:
        yield Finding("OpenGL", False, str(error), optional=True)
        return
    for backend in tried:
        drawn = works(backend)
        yield Finding(f"OpenGL {backend}", drawn, "draws" if drawn else "does not work here", optional=True)
    try:
        yield Finding("frames and videos", True, f"drawn with {find_backend()}")
    except RenderingUnavailable as error:
        yield Finding("frames and videos", False, str(error))


def _ffmpeg() -> Finding:
    remedy = "unset IMAGEIO_FFMPEG_EXE" if os.environ.get("IMAGEIO_FFMPEG_EXE") else "pip install imageio-ffmpeg"
    if find_spec("imageio_ffmpeg") is None:
        return Finding("ffmpeg", False, "not installed", remedy)
    import imageio_ffmpeg

    try:
        if found := imageio_ffmpeg.get_ffmpeg_version():
            return Finding("ffmpeg", True, found)
    except (RuntimeError, OSError):
        return Finding("ffmpeg", False, "not found", remedy)
    except (IndexError, ValueError, subprocess.SubprocessError):
        pass
    return Finding("ffmpeg", False, f"{imageio_ffmpeg.get_ffmpeg_exe()} is no ffmpeg", remedy)


def _optional_packages() -> dict[str, str]:
    """Packages that an extra of annelid asks for, each with the smallest such extra; without those of developers."""
    extras: dict[str, list[str]] = {}
    for line in requires("annelid") or []:
        asked = re.match(r"([\w.-]+).*;.*extra == ['\"]([\w-]+)['\"]", line)
        if asked is not None and asked[2] not in _DEVELOPERS_EXTRAS:
            extras.setdefault(asked[2], []).append(asked[1])
    smallest_last = sorted(extras, key=lambda extra: len(extras[extra]), reverse=True)
    remedies = {package: extra for extra in smallest_last for package in extras[extra]}
    return dict(sorted(remedies.items(), key=lambda remedy: (remedy[1], remedy[0])))


def bug_report(findings: Sequence[Finding]) -> str:
    """Returns what a bug report should say of a machine, as Markdown: versions, processor, and what `examine` found."""
    try:
        core = version("mujoco-core")
    except PackageNotFoundError:
        core = "not installed"
    backend = os.environ.get("MUJOCO_GL") or "not set"
    facts = {
        "annelid": " ".join(filter(None, (version("annelid"), _commit()))),
        "mujoco-core": core,
        "Python": f"{platform.python_version()} ({platform.python_implementation()})",
        "system": f"{platform.system()} {platform.release()} {platform.machine()} {' '.join(platform.libc_ver())}",
        "processor": f"{_processor()}, {os.cpu_count()} logical cores",
        "MUJOCO_GL": backend if backend in ("not set", *BACK_ENDS) else "set to something else than a back-end",
    }
    lines = [f"- {name}: {without_names(value).strip()}" for name, value in facts.items()]
    rows = [f"| {each.item} | {each.state} | {without_names(each.detail)} |" for each in findings]
    return "\n".join([*lines, "", "| item | state | detail |", "|---|---|---|", *rows])


def without_names(text: str) -> str:
    """Returns a text in which paths are cut down to their last part, and the user and the machine are not named."""
    text = text.replace(str(Path.home()), "/HOME") if len(Path.home().parts) > 1 else text
    text = _PATH.sub(lambda path: "../" + re.split(r"[/\\]", path[0].rstrip("/\\"))[-1], text)
    names = {platform.node(): "MACHINE", platform.node().split(".")[0]: "MACHINE"}
    # A user without a name, as in some containers, needs none hidden.
    with suppress(OSError, KeyError, ImportError):
        names = {getpass.getuser(): "USER"} | names
    for name, instead in names.items():
        text = re.sub(rf"(?<!\w){re.escape(name)}(?!\w)", instead, text) if name else text
    return " ".join(text.replace("|", "/").split())


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
    root = Path(__file__).parents[3]
    if not (root / ".git").exists():
        return ""
    with suppress(OSError, subprocess.SubprocessError):
        commit = _answer("git", "-C", str(root), "rev-parse", "--short=12", "HEAD")
        changed = _answer("git", "-C", str(root), "status", "--porcelain", "--untracked-files=no")
        return f"(commit {commit}{', modified' if changed else ''})"
    return ""


def _answer(*command: str) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
