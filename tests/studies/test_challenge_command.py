from __future__ import annotations

import sys
from pathlib import Path

import pytest

import annelid_studies.challenge
from outcome import Command

MINE = "[mine]\ncontroller = {kind = 'sine'}\ntuned_on = [0, 1001]\n"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("nobody",), "unknown entrant 'nobody'"),
        (("mine.toml",), "tuned_on has test seeds (1001): tune on seeds below 1000"),
        (("none:Controller",), "none cannot be imported"),
        (("--task", "slop"), "unknown task 'slop': did you mean 'slope'?"),
        (("--body", "seven"), "unknown body 'seven'"),
        (("sns", "--tune", "2"), "says in `vary` what is searched"),
        (("--with", "none.csv"), "none.csv is no runs.csv"),
    ],
)
def test_what_cannot_be_ranked_is_refused_in_a_sentence(
    annelid: Command, arguments: tuple[str, ...], says: str
) -> None:
    Path("mine.toml").write_text(MINE, encoding="utf-8")
    done = annelid("study", "challenge", *arguments, "--quiet")
    assert done.exit_code == 2
    assert says in done.sentence()
    assert not list(Path().glob("challenge/runs/*"))


def test_training_names_the_line_that_installs_its_library(annelid: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    # Another test may have loaded the module: its package has it, too.
    monkeypatch.delitem(sys.modules, "annelid_studies.challenge.learning", raising=False)
    monkeypatch.delattr(annelid_studies.challenge, "learning", raising=False)
    done = annelid("study", "challenge", "--train", "1000", "--quiet")
    assert done.exit_code == 2
    assert "pip install 'annelid[learn]'" in done.sentence()


@pytest.mark.slow
def test_two_quick_rankings_are_identical(annelid: Command) -> None:
    for folder in ("one", "two"):
        done = annelid("study", "challenge", "--quick", "-o", folder)
        assert done.exit_code == 0, done.err
        assert "speed" in done.out
    names = ("runs.csv", "scores.csv", "pairs.csv", "challenge.png", "challenge.svg")
    assert done.out.splitlines()[-4:] == [str(Path("two", name)) for name in names[:4]]
    for name in names:
        assert Path("one", name).read_bytes() == Path("two", name).read_bytes()
