from __future__ import annotations

import platform
from pathlib import Path

import pytest

from annelid.draw.doctor import Finding, bug_report

FINDINGS = [
    Finding("numpy", True, "2.4.6"),
    Finding("ffmpeg", False, "/home/ada/secret/ffmpeg is no ffmpeg", "unset IMAGEIO_FFMPEG_EXE"),
    Finding("torch", False, "not installed", "pip install 'annelid[sns]'", optional=True),
]


def test_the_report_is_markdown_with_every_finding_and_names_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "secret-token")
    text = bug_report(FINDINGS)
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("|")]
    assert rows[2:] == [["numpy", "ok", "2.4.6"], ["ffmpeg", "missing", ""], ["torch", "optional", ""]]
    assert platform.python_version() in text
    assert platform.machine() in text
    assert not any(name in text for name in ("secret", "ada", str(Path.home())))
