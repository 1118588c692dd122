"""What a command ends with says what happened, and the page that lists the codes lists these."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import pytest

from annelid.cli import entry
from annelid.errors import RunKilled
from annelid.experiment.sweep import Sweep
from outcome import STUDY, Command

pytestmark = pytest.mark.usefixtures("runs_in_this_process")

PAGE = Path(__file__).parents[2] / "docs" / "troubleshooting.md"
GOOD, BAD = "1.0", "1e4"


@pytest.fixture(autouse=True)
def _computed_and_not_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Results get no figure."""
    for figure in ("sweep.sweep_figure", "tune._figure"):
        monkeypatch.setattr(f"annelid.experiment.{figure}", lambda *_: Path("figure.png"))


def test_the_page_lists_the_exit_codes() -> None:
    section = PAGE.read_text(encoding="utf-8").split("## Exit codes")[1].split("\n## ")[0]
    listed = [int(code) for code in re.findall(r"^\| (\d+) \|", section, re.MULTILINE)]
    assert listed == [value for name, value in vars(entry).items() if name.startswith("EXIT_")]


@pytest.mark.parametrize(
    ("values", "code", "words"),
    [
        (f"{GOOD}, 0.9", entry.EXIT_DONE, ""),
        (f"{GOOD}, {BAD}", entry.EXIT_SOME_FAILED, "of 2 runs 1 failed: the reasons are in sweep/sweep.csv"),
        (f"{BAD}, 2e4", entry.EXIT_ALL_FAILED, "of 2 runs 2 failed"),
        ("-1.0", entry.EXIT_USAGE, "body.gain = -1.0"),
    ],
)
def test_a_sweep_that_says_nothing_else_says_what_happened_to_its_runs(
    annelid: Command, values: str, code: int, words: str
) -> None:
    Path("study.toml").write_text(STUDY.format(values=values))
    done = annelid("sweep", "study.toml", "--quiet", "--jobs", "1")
    assert done.exit_code == code, done.err
    assert words in done.err.replace("\\", "/")


def test_a_sweep_tells_of_runs_that_a_guard_stopped(annelid: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    from annelid.experiment.store import Done
    from annelid.experiment.sweep import swept

    def stopped(*words: object, **options: object) -> Sweep:
        done = swept(*words, **options)  # type: ignore[arg-type]
        outcomes = [run.outcome for run in done.runs if run.outcome is not None]
        runs = tuple(Done(replace(outcome, message="too fast")) for outcome in outcomes)
        return replace(done, runs=runs)

    monkeypatch.setattr("annelid.experiment.sweep.swept", stopped)
    Path("study.toml").write_text(STUDY.format(values=GOOD))
    done = annelid("sweep", "study.toml", "--quiet", "--jobs", "1")
    assert done.exit_code == entry.EXIT_STOPPED
    assert "of 1 runs 1 were stopped by a guard" in done.err


def test_a_search_that_finds_no_gait_says_so(annelid: Command) -> None:
    words = ["riddle2022-planar", "--duration", "0.1", "--vary", "controller.gate_time_constant_ms=100:600"]
    done = annelid("tune", *words, "--trials", "1", "--quiet", "--jobs", "1")
    assert done.exit_code == entry.EXIT_ALL_FAILED, done.err
    assert "no trial walked" in done.err


def test_a_study_whose_worker_dies_again_and_again_says_so(annelid: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    killed = Mock(side_effect=RunKilled("its worker died 3 times"))
    monkeypatch.setattr("annelid_studies.riddle2023.paper.reproduce", killed)
    done = annelid("paper", "--quiet")
    assert (done.exit_code, done.sentence()) == (entry.EXIT_SOME_FAILED, "its worker died 3 times")


# One process a row: what is told there goes to streams of the system.
STREAMS = [
    ("cite riddle2023 >&-", entry.EXIT_DONE, ""),
    ("cite riddle2023 >/dev/full", entry.EXIT_USAGE, "annelid: cannot print, or write a file: No space left on device"),
    ("cite nosuch 2>/dev/full", entry.EXIT_USAGE, ""),
    ("--help | true", entry.EXIT_BUG, ""),
]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is always full")
def test_a_stream_that_takes_nothing_ends_no_command_in_a_traceback(subtests: pytest.Subtests) -> None:
    for line, code, told in STREAMS:
        with subtests.test(f"{line!r:.60}"):
            arguments, slash, rest = line.partition("|")
            # The reader of the pipe is gone before anything is written.
            script = f'"$0" -m annelid {arguments} {slash} {rest}; exit ${{PIPESTATUS[0]}}'
            done = subprocess.run(
                ["bash", "-c", script, sys.executable], capture_output=True, text=True, check=False, timeout=120
            )
            assert (done.returncode, done.stdout, done.stderr.strip()) == (code, "", told)


def test_the_help_lists_every_code(annelid: Command) -> None:
    said = re.search(r"Exit codes:(.*?)\.", " ".join(annelid("--help").out.split()))
    assert said is not None
    codes = {value for name, value in vars(entry).items() if name.startswith("EXIT_")}
    assert {int(code) for code in re.findall(r"\d+", said[1])} == codes
