from __future__ import annotations

import io
import os
import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from annelid.experiment.progress import LINE_EVERY_S, Lines, study_progress
from annelid_studies.papers.report_parts import Claim, Report, Table
from annelid_studies.riddle2023.paper import PAPER
from annelid_studies.riddle2025.paper import PAPER as LATER
from annelid_studies.standard_cases import Effort
from outcome import Command

CLAIM = Claim("results", "It walks", "Sect. 4", "2.635 s", "2.629 s", "It does.", "annelid run riddle2023", "holds")
NUMBERS = Table(["period, s"], [["2.629"]])
REPORT = Report(PAPER, "full", ["It walks."], NUMBERS, NUMBERS, [], [CLAIM], [], {"annelid": "0"})

Asked = list[tuple[Path, Effort, Sequence[str] | None, int]]


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> Asked:
    """Puts a report in the place of the runs; returns with what it was asked for."""
    calls: Asked = []

    def reproduce(folder: Path, effort: Effort, *, only: Sequence[str] | None, executor: Any, progress: Any) -> Report:
        calls.append((folder, effort, only, executor._max_workers))
        if progress is not None:
            progress("running worms", 1, 2, 0.5)
        return REPORT

    monkeypatch.setattr("annelid_studies.riddle2023.paper.reproduce", reproduce)
    return calls


def fails_with(error: BaseException) -> Callable[..., Report]:
    def reproduce(*_: object, **__: object) -> Report:
        raise error

    return reproduce


def test_writes_the_report_and_prints_its_paths(annelid: Command, asked: Asked) -> None:
    done = annelid("paper")
    assert done.exit_code == 0, done.err
    assert done.out.split() == ["report/report.html", "report/report.md"]
    assert all(Path(path).stat().st_size > 0 for path in done.out.split())
    assert asked == [(Path("report"), "full", None, os.cpu_count())]


def test_another_paper_has_a_folder_of_its_own(annelid: Command, asked: Asked, monkeypatch: pytest.MonkeyPatch) -> None:
    folders: list[Path] = []

    def reproduce(folder: Path, effort: Effort, **_: object) -> Report:
        folders.append(folder)
        return replace(REPORT, paper=LATER, files=[folder / "riddle2025.csv"])

    monkeypatch.setattr("annelid_studies.riddle2025.paper.reproduce", reproduce)
    done = annelid("paper", "riddle2025", "--claims", "claims.md", "-q")
    assert done.out.split() == [f"riddle2025/{name}" for name in ("report.html", "report.md", "riddle2025.csv")] + [
        "claims.md"
    ]
    assert Path("claims.md").read_text("utf-8").startswith("# The claims of the paper of 2025")
    assert (folders, asked) == ([Path("riddle2025")], [])


def test_hands_its_options_on(annelid: Command, asked: Asked) -> None:
    done = annelid("paper", "-o", "a/b", "--quick", "--only", "pins", "--only", "friction", "--jobs", "3", "-q")
    assert done.exit_code == 0, done.err
    assert asked == [(Path("a/b"), "quick", ["pins", "friction"], 3)]
    assert Path("a/b/report.html").is_file()
    assert done.err == ""


def test_writes_the_claims_where_they_are_wanted(annelid: Command, asked: Asked) -> None:
    Path("docs/evidence").mkdir(parents=True)
    Path("docs/evidence/paper.md").write_text("as it was")
    done = annelid("paper", "--claims", "docs/evidence/paper.md", "-q")
    assert done.out.split()[-1] == "docs/evidence/paper.md"
    assert "| 1 | It walks | **holds** | 2.635 s | 2.629 s |" in Path("docs/evidence/paper.md").read_text("utf-8")


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--jobs", "0"], "Invalid value for '--jobs'"),
        (["--claims", "claims.md", "--only", "pins"], "--claims needs the whole report"),
        (["--claims", "nowhere/claims.md"], "there is no folder nowhere"),
        (["--claims", "claims.html"], "must end in .md"),
        (["riddle2025", "--only", "pins"], "riddle2025 has none"),
        (["riddle2022"], "'riddle2023', 'riddle2025'"),
        (["-o", "taken"], "taken is a file"),
    ],
)
def test_refuses_before_anything_is_computed(
    annelid: Command, asked: Asked, arguments: list[str], complaint: str
) -> None:
    Path("taken").touch()
    done = annelid("paper", *arguments)
    assert done.exit_code == 2
    assert complaint in " ".join(done.err.split())
    assert asked == []


@pytest.mark.parametrize(
    "arguments",
    [
        ("-o", "my report", "--quick", "--only", "pins", "--jobs", "1"),
        ("-o", "my report", "--claims", "my claims.md"),
    ],
)
def test_ctrl_c_tells_how_to_go_on(
    annelid: Command, asked: Asked, monkeypatch: pytest.MonkeyPatch, arguments: Sequence[str]
) -> None:
    with monkeypatch.context() as broken:
        broken.setattr("annelid_studies.riddle2023.paper.reproduce", fails_with(KeyboardInterrupt()))
        done = annelid("paper", *arguments)
    assert done.exit_code == 130
    sentence = done.sentence()
    assert "finished runs are kept in my report/runs" in sentence
    again = shlex.split(sentence.partition("go on with: ")[2])
    assert again == ["annelid", "paper", *arguments]
    assert annelid(*again[1:]).exit_code == 0
    assert [folder for folder, *_ in asked] == [Path("my report")]


def test_without_a_terminal_progress_is_a_line(annelid: Command, asked: Asked) -> None:
    assert annelid("paper").err == "running worms: 1 of 2 runs, 50%\n"


class Clock:
    """Stands for the module `time`."""

    now = 0.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr("annelid.experiment.progress.time", clock)
    return clock


def test_lines_come_at_most_every_ten_seconds(clock: Clock) -> None:
    stream = io.StringIO()
    tell = Lines(stream)
    for second in range(101):
        clock.now = float(second)
        tell("running worms", second, 200, second / 200)
    lines = stream.getvalue().splitlines()
    assert len(lines) == 1 + 100 // LINE_EVERY_S
    assert lines[1] == "running worms: 10 of 200 runs, 5%"


def test_a_short_run_writes_no_line(clock: Clock) -> None:
    stream = io.StringIO()
    lines = Lines(stream, at_once=False)
    for second in range(11):
        assert not stream.getvalue()
        clock.now = float(second)
        lines("simulating", 0, 0, second / 20)
    assert stream.getvalue() == "simulating: 50%\n"


def test_on_a_terminal_progress_is_a_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = io.StringIO()
    monkeypatch.setattr(stream, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setattr(sys, "stderr", stream)
    with study_progress() as progress:
        assert progress is not None
        progress("running [worms]", 3, 7, 0.4)
    assert "running [worms]" in stream.getvalue()
    assert "3 of 7 runs" in stream.getvalue()
