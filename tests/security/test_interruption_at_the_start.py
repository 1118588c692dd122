"""Interrupted in its first moments, a command ends without a traceback, whatever it is loading."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
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
            os.kill(os.getpid(), signal.{signal})
sys.meta_path.insert(0, Interrupted())
sys.argv = ["annelid", "run", "riddle2023-rods", "--duration", "0.1", "--no-video", "--out", "out"]
runpy.run_module("annelid", run_name="__main__")
"""


def heed_interruption() -> None:
    """Undoes what nohup and background jobs of a shell do."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.mark.parametrize("module", ["annelid.cli", "mujoco._specs"])
def test_interrupted_while_it_loads_it_ends_in_a_sentence(tmp_path: Path, module: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", AT_IMPORT.format(module=module, signal="SIGINT")],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=heed_interruption,
        timeout=120,
    )
    assert done.stderr == "annelid: interrupted\n"
    assert done.returncode == 130


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
