from __future__ import annotations

import json
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from outcome import Command

REPORT = {
    "machine": "2 cores",
    "cases": [],
    "cost_exponents": {},
    "levels": {},
}

Asked = list[tuple[Path, str, Sequence[str] | None]]


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> Asked:
    """Puts an empty report in the place of the measurements; returns with what was asked for."""
    calls: Asked = []

    def bench(folder: Path, effort: str, *, lines: Sequence[str] | None, progress: Any) -> Path:
        calls.append((folder, effort, lines))
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / "bench.json"
        path.write_text(json.dumps(REPORT))
        return path

    monkeypatch.setattr("annelid_studies.bench.benchmark.bench", bench)
    return calls


def test_prints_the_table_and_the_paths(annelid: Command, asked: Asked) -> None:
    done = annelid("study", "bench")
    assert done.exit_code == 0, done.err
    assert done.out.splitlines()[-2:] == ["bench/bench.json", "bench/bench.png"]
    assert Path("bench/bench.svg").is_file()
    assert asked == [(Path("bench"), "full", None)]


def test_hands_its_options_on(annelid: Command, asked: Asked) -> None:
    done = annelid("study", "bench", "-o", "a/b", "--quick", "--cases", "steps", "--cases", "levels", "-q")
    assert done.out.split() == ["a/b/bench.json", "a/b/bench.png"]
    assert done.err == ""
    assert asked == [(Path("a/b"), "quick", ["steps", "levels"])]


def test_an_unknown_line_is_one_sentence(annelid: Command) -> None:
    done = annelid("study", "bench", "--cases", "stepps")
    assert done.exit_code == 2
    assert "did you mean 'steps'" in done.sentence()
    assert not list(Path().iterdir())


def test_ctrl_c_tells_how_to_go_on(annelid: Command, asked: Asked, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> Path:
        raise KeyboardInterrupt

    arguments = ("-o", "my bench", "--quick", "--cases", "steps")
    with monkeypatch.context() as broken:
        broken.setattr("annelid_studies.bench.benchmark.bench", interrupted)
        done = annelid("study", "bench", *arguments)
    assert done.exit_code == 130
    assert "what was measured is kept in my bench/cases" in done.sentence()
    again = shlex.split(done.sentence().partition("go on with: ")[2])
    assert again == ["annelid", "study", "bench", *arguments]
    assert annelid(*again[1:]).exit_code == 0
