"""Interrupted in its first moments, a command ends without a traceback, whatever it is loading."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no signal for one process")

# Sends the signal to itself where the named module is looked for.
AT_IMPORT = """
import os, runpy, signal, sys
class Interrupted:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Interrupted())
sys.argv = ["annelid", "list", "presets"]
runpy.run_module("annelid", run_name="__main__")
"""


def interrupted(module: str, handler: Callable[..., object] | signal.Handlers) -> subprocess.CompletedProcess[str]:
    """Runs a command that is interrupted where it looks for a module, with what its parent does with interruptions."""
    return subprocess.run(
        [sys.executable, "-c", AT_IMPORT.format(module=module)],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: signal.signal(signal.SIGINT, handler),  # type: ignore[arg-type]
        timeout=120,
    )


def test_interrupted_while_it_loads_it_says_nothing_or_a_sentence() -> None:
    done = interrupted("annelid.cli", signal.SIG_DFL)
    assert (done.returncode, done.stderr) == (-signal.SIGINT, "")
    done = interrupted("annelid.config.loading", signal.SIG_DFL)
    assert (done.returncode, done.stderr) == (130, "annelid: interrupted\n")


def test_where_interruptions_are_ignored_they_stay_so() -> None:
    done = interrupted("typer", signal.SIG_IGN)
    assert done.returncode == 0, done.stderr
    assert "riddle2023" in done.stdout


def test_a_terminal_that_knows_ascii_only_is_served(tmp_path: Path) -> None:
    (tmp_path / "w.toml").write_text('extends = "riddle2022-planar"\nsummary = "🪱"\n', encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "annelid", "list", "presets", "w.toml", "--fields"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
        capture_output=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
