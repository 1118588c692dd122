from __future__ import annotations

import getpass
import platform
import subprocess
from pathlib import Path, PurePosixPath

import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.draw import doctor as module
from annelid.draw.doctor import Finding, bug_report, without_names

NAMES = st.text("abcdefghijklmnopqrstuvwxyz0123456789.-_ÄÖ", min_size=1, max_size=12)
FINDINGS = [
    Finding("numpy", True, "2.4.6"),
    Finding("ffmpeg", False, "/home/ada/secret/ffmpeg is no ffmpeg", "unset IMAGEIO_FFMPEG_EXE"),
    Finding("torch", False, "not installed", "pip install 'annelid[sns]'", optional=True),
]


@given(st.lists(NAMES, min_size=2, max_size=6), st.sampled_from(["", "file://", "'", "cannot load "]))
def test_of_a_path_only_its_last_part_is_told(parts: list[str], before: str) -> None:
    folders = [f"{part}folder" for part in parts[:-1]]
    told = without_names(f"{before}{PurePosixPath('/', *folders, 'lib.so')}: cannot open")
    assert told.endswith("../lib.so: cannot open")
    assert "folder" not in told


def test_neither_user_nor_machine_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(getpass, "getuser", lambda: "ada")
    monkeypatch.setattr(platform, "node", lambda: "engine.lovelace.org")
    told = without_names("ada on engine.lovelace.org, engine, C:\\Users\\ada\\ff.exe; adamant engines stay")
    assert told == "USER on MACHINE, MACHINE, ../ff.exe; adamant engines stay"


def test_a_home_with_blanks_is_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "home", lambda: Path("/Users/Ada Lovelace"))
    assert "Lovelace" not in without_names("/Users/Ada Lovelace/bin/ffmpeg is no ffmpeg")


def test_the_report_is_markdown_with_every_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "secret-token")
    text = bug_report(FINDINGS)
    rows = [line.split("|")[1:-1] for line in text.splitlines() if line.startswith("|")]
    assert [[cell.strip() for cell in row] for row in rows[2:]] == [
        ["numpy", "ok", "2.4.6"],
        ["ffmpeg", "missing", "../ffmpeg is no ffmpeg"],
        ["torch", "optional", "not installed"],
    ]
    assert platform.python_version() in text
    assert platform.machine() in text
    assert "secret" not in text
    assert str(Path.home()) not in text


def test_the_commit_of_a_checkout_is_told_and_nothing_of_an_installed_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "src" / "annelid" / "draw"
    source.mkdir(parents=True)
    (source / "doctor.py").write_text("")
    monkeypatch.setattr(module, "__file__", str(source / "doctor.py"))
    assert "commit" not in bug_report([])
    git = ["git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=a@b"]
    for command in (["init", "-q"], ["add", "."], ["commit", "-qm", "first"]):
        subprocess.run([*git, *command], check=True, timeout=120)
    head = subprocess.run([*git, "rev-parse", "HEAD"], capture_output=True, text=True, check=True, timeout=120).stdout
    assert f"(commit {head[:12]})" in bug_report([])
    (source / "doctor.py").write_text("1")
    assert f"(commit {head[:12]}, modified)" in bug_report([])
