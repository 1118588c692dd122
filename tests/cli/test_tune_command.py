from __future__ import annotations

from pathlib import Path

import pytest

from annelid.config import load_config
from outcome import Command

pytestmark = pytest.mark.usefixtures("runs_in_this_process")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--objective", "pace"), "unknown objective 'pace'"),
        (("--objective", "slip", "--objective", "slip"), "one or two of"),
        (("--vary", "controller.gate_ms=1:2"), "did you mean"),
        (("--vary", "arena.friction=1:0.5"), "be below to = 0.5"),
        (("--set", "controller.kind=pogram"), "controller.kind = 'pogram'"),
        (("crawlr",), "unknown preset 'crawlr'"),
    ],
)
def test_bad_input_ends_in_one_sentence_before_anything_runs(
    annelid: Command, arguments: tuple[str, ...], says: str
) -> None:
    done = annelid("tune", *arguments)
    assert done.exit_code == 2
    assert says in done.sentence()
    assert not list(Path().iterdir())


@pytest.mark.parametrize("command", [("tune",), ("study", "speed")])
def test_results_need_a_folder(annelid: Command, command: tuple[str, ...]) -> None:
    Path("taken").write_text("mine")
    done = annelid(*command, "-o", "taken")
    assert done.exit_code == 2
    assert "taken is a file" in done.sentence()
    assert Path("taken").read_text() == "mine"


@pytest.mark.slow
def test_a_tuned_gait_runs_and_a_second_call_computes_nothing(
    annelid: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = ("tune", "riddle2025-muscles", "--trials", "2", "--duration", "8", "-o", "tune")
    done = annelid(*arguments)
    assert done.exit_code == 0, done.err
    assert done.out.splitlines()[-3:] == [str(Path("tune", name)) for name in ("trials.csv", "tuning.png", "best.toml")]
    best = load_config("tune/best.toml")
    assert best.name == "best"
    monkeypatch.setattr("annelid.experiment.store.attempt", None)
    assert annelid(*arguments).exit_code == 0
    assert load_config("tune/best.toml") == best
