"""The README's Python example and its commands are what the package really has."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")


def test_the_python_example_runs(tmp_path: Path) -> None:
    example = re.search(r"```python\n(.*?)```", README, re.DOTALL)
    assert example is not None
    short = example.group(1).replace('{"arena.friction": 0.3}', '{"arena.friction": 0.3, "duration_s": 0.1}')
    assert short != example.group(1)
    answer = subprocess.run(
        [sys.executable, "-c", short], cwd=tmp_path, capture_output=True, text=True, check=True, env=os.environ.copy()
    )
    assert "stretch_length" in answer.stdout
    assert (tmp_path / "runs" / "wave" / "run.nc").exists()


@pytest.mark.parametrize("command", sorted(set(re.findall(r"`annelid (\w+)[ `]", README))))
def test_every_command_that_it_names_exists(command: str) -> None:
    subprocess.run([sys.executable, "-m", "annelid", command, "--help"], capture_output=True, check=True)


def test_every_file_that_it_links_exists() -> None:
    root = Path(__file__).parent.parent
    links = re.findall(r"\]\((?!http)([^)#]+)\)", README)
    assert links
    assert [link for link in links if not (root / link).exists()] == []
