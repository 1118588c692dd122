from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Any

import pytest

from annelid.experiment import uncertainty as package
from annelid.simulation.runfile import open_run
from outcome import Command

pytestmark = pytest.mark.usefixtures("runs_in_this_process")

RODS = "riddle2023-rods"
TINY = ("--duration", "0.1", "--no-video", "--jobs", "1")


def test_an_interrupted_study_names_the_command_that_goes_on(annelid: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[dict[str, Any]] = []

    def interrupted(config: object, n: int, folder: Path, **options: Any) -> None:
        seen.append({"config": config, "n": n, "folder": folder, "errors": options["spread"].relative_error.tolist()})
        raise KeyboardInterrupt

    monkeypatch.setattr(package, "uncertainty", interrupted)
    words = ("--segments", "4", "--set", "controller={kind='sns-robust'}", "--vary", "floor_friction=0.2")
    done = annelid("run", "riddle2023-rods", *words, "--seed", "5", "--uncertainty", "3", "-o", "my walk")
    assert done.exit_code == 130
    sentence = done.sentence()
    assert "finished runs are kept in my walk" in sentence
    program, *again = shlex.split(sentence.partition("go on with: ")[2])
    assert program == "annelid"
    annelid(*again)
    assert seen[0] == seen[1]
    # A folder that was found for it is named, so that the command goes on there.
    sentence = annelid("run", "riddle2023-rods", "--uncertainty", "3").sentence()
    again = shlex.split(sentence.partition("go on with: ")[2])
    assert again[-2:] == ["--out", str(seen[-1]["folder"])]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("riddle2022-planar",), "body.kind = 'riddle2022' has no calibrated parameters"),
        ((RODS, "--vary", "floor_frction=0.1"), "did you mean 'floor_friction'"),
        ((RODS, "--vary", "floor_friction=much"), "the relative error must be a number"),
        ((RODS, "--vary", "floor_friction=true"), "the relative error must be a number"),
        ((RODS, "--vary", "floor_friction"), "not of the form field=value"),
        ((RODS, "--vary", "spring_rate=2"), "below 1"),
        ((RODS, "--uncertainty-from", "none.json"), "cannot read none.json"),
    ],
)
def test_bad_input_ends_in_one_sentence_and_leaves_nothing(
    annelid: Command, arguments: tuple[str, ...], says: str
) -> None:
    done = annelid("run", *arguments, "--uncertainty", "2", "--duration", "0.1")
    assert done.exit_code == 2
    assert says in done.sentence()
    assert not list(Path().iterdir())


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--uncertainty", "1"), "greater than or equal to 2"),
        (("--vary", "spring_rate=0.1"), "need --uncertainty"),
        (("--jobs", "2"), "needs --check or --uncertainty"),
        (("--uncertainty-from", "c.json"), "need --uncertainty"),
        (("--uncertainty", "2", "--resume", "walk"), "does not go with --resume"),
    ],
)
def test_wrong_usage_says_what_is_missing(annelid: Command, arguments: tuple[str, ...], says: str) -> None:
    done = annelid("run", *arguments)
    assert done.exit_code == 2
    assert "Usage:" in done.err
    assert says in done.err


@pytest.mark.usefixtures("undrawn")
def test_force_replaces_a_run(annelid: Command) -> None:
    command = ("run", "riddle2022-planar", "--duration", "0.1", "--no-video", "-q", "-o", "here")
    assert annelid(*command).exit_code == 0
    assert "is not empty" in annelid(*command, "--seed", "4").sentence()
    assert open_run("here").config.seed == 0
    assert annelid(*command, "--seed", "4", "--force").exit_code == 0
    assert open_run("here").config.seed == 4


@pytest.mark.usefixtures("undrawn")
def test_a_checked_run_says_how_far_its_numbers_move(annelid: Command) -> None:
    command = ("run", "riddle2022-planar", "--duration", "3", "--check", "--jobs", "1", "-o", "walk")
    done = annelid(*command)
    assert done.exit_code == 0, done.err
    assert "moves by" in done.out
    assert "Resolved: with half the step (0.5 ms) no number moves by more than 10 %" in " ".join(done.out.split())
    content = json.loads(annelid(*command, "--json").out)["results"]["check.json"]
    assert content == json.loads(Path("walk/check.json").read_text())
    assert content["resolved"] is True
    for words, sentence in (
        (("--check", "--uncertainty", "4"), "--uncertainty has what --check does"),
        (("--check", "--resume", "walk"), "makes whole runs"),
        (("--jobs", "2"), "--jobs needs --check or --uncertainty"),
    ):
        assert sentence in " ".join(annelid("run", *words).err.split())


@pytest.mark.usefixtures("undrawn")
def test_an_interrupted_check_keeps_the_run_and_names_the_command(
    annelid: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    from annelid.experiment import check as checking

    def interrupted(*given: object, **options: object) -> None:
        raise KeyboardInterrupt

    assert annelid("run", "riddle2022-planar", "--duration", "1", "--no-video", "-q", "-o", "walk").exit_code == 0
    monkeypatch.setattr(checking, "check", interrupted)
    done = annelid("run", "riddle2022-planar", "--duration", "1", "--check", "-o", "walk")
    assert done.exit_code == 130
    assert "the run is kept in walk/run.nc; check it with: annelid run" in " ".join(done.err.split())
