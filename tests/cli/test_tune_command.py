from __future__ import annotations

from pathlib import Path

import pytest

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
