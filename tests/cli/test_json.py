"""Every command prints its result as strict JSON on stdout and nothing else, or is listed here with the reason."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from importlib import import_module
from inspect import isfunction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from typer.main import get_command

from annelid.cli import app, entry
from annelid.output import write_csv
from annelid_studies.commands.experiment import STUDIES, Study
from outcome import STUDY, Command, Outcome

pytestmark = pytest.mark.usefixtures("runs_in_this_process", "undrawn")

PAGE = Path(__file__).parents[2] / "docs" / "data_out.md"
NO_RESULT = {
    "view": "a view goes on until it is closed",
    "cite": "BibTeX is a format for programs already",
}
ELSEWHERE = {"paper", "study paper", "study bench"}
"""What takes minutes, and what its own tests run without the option, which it has as all others do."""
ROWS = [{"run": "007", "speed_m_per_s": 0.5, "slip": None, "ordered": True, "problem": "silent"}]
"""What the tables of the studies hold here that need minutes in earnest."""


def write_rows(*arguments: Any) -> Path:
    path = next(argument for argument in arguments if isinstance(argument, Path))
    path.parent.mkdir(exist_ok=True)
    return write_csv(path, [*ROWS[0], "drift"], [["007", "0.5", float("nan"), True, "silent", "-inf"]])


def picture(*_: object, **__: object) -> Path:
    return Path("picture.png")


def fake(monkeypatch: pytest.MonkeyPatch, module: str, **found: object) -> None:
    """Puts these results in the place of what a study computes; its tables are `ROWS`, its pictures are not drawn."""
    study = import_module(module)
    assert found.keys() <= vars(study).keys(), "what is replaced is there"
    for name, function in vars(study).items():
        if not isfunction(function):
            continue
        if name in found:
            monkeypatch.setattr(study, name, lambda *_, _found=found[name], **__: _found)
        elif name.startswith("write_"):
            monkeypatch.setattr(study, name, write_rows)
        elif name.endswith(("figure", "picture")) or name.startswith("draw_"):
            monkeypatch.setattr(study, name, picture)
        elif name.endswith("_table"):
            monkeypatch.setattr(study, name, lambda *_: None)


def challenge(annelid: Command, _: Path, monkeypatch: pytest.MonkeyPatch) -> Outcome:
    for module, found in {"scores": {"challenge": []}, "ranking": {"standings": [], "pairs": []}, "report": {}}.items():
        fake(monkeypatch, f"annelid_studies.challenge.{module}", **found)
    return annelid("study", "challenge", "--quick", "--json")


def studied(of: Study) -> Callable[[Command, Path, pytest.MonkeyPatch], Outcome]:
    """Runs a study with `ROWS` in the place of what it computes."""

    def written(_: object, output: Path, *__: object, **___: object) -> tuple[list[Path], list[object]]:
        return [write_rows(output / "rows.csv")], []

    def run(annelid: Command, _: Path, monkeypatch: pytest.MonkeyPatch) -> Outcome:
        monkeypatch.setattr(f"annelid_studies.{of.module}.{of.function}", written)
        return annelid("study", of.name, "--quick", "--json")

    return run


STUDIED: dict[str, Callable[[Command, Path, pytest.MonkeyPatch], Outcome]] = {
    "study challenge": challenge,
    **{f"study {one.name}": studied(one) for one in STUDIES},
}


def calibrate(annelid: Command, finished: Path, monkeypatch: pytest.MonkeyPatch) -> Outcome:
    report = "annelid_lab.calibration.report"
    monkeypatch.setattr(f"{report}.identify", lambda *_: SimpleNamespace(warnings=()))
    monkeypatch.setattr(f"{report}.write_identified", lambda _, folder: [folder / "calibrated.toml"])
    monkeypatch.setattr(f"{report}.tables", lambda _: [])
    return annelid("calibrate", "--json")


def sweep(annelid: Command, finished: Path, monkeypatch: pytest.MonkeyPatch) -> Outcome:
    monkeypatch.setattr("annelid.experiment.sweep.sweep_figure", picture)
    Path("study.toml").write_text(STUDY.format(values="1.0, 0.9"))
    return annelid("sweep", "study.toml", "--json", "--jobs", "1")


def tune(annelid: Command, finished: Path, monkeypatch: pytest.MonkeyPatch) -> Outcome:
    monkeypatch.setattr("annelid.experiment.tune._figure", picture)
    words = ("--duration", "0.1", "--vary", "controller.gate_time_constant_ms=100:600", "--trials", "1", "--jobs", "1")
    return annelid("tune", "riddle2022-planar", *words, "--json")


def typed(*words: str) -> Callable[[Command, Path, pytest.MonkeyPatch], Outcome]:
    """Runs a command as it is, on a finished run where RUN stands."""
    return lambda annelid, finished, _: annelid(*(finished if word == "RUN" else word for word in words), "--json")


def loop(annelid: Command, _: Path, monkeypatch: pytest.MonkeyPatch) -> Outcome:
    # Busy tests beside it must not end it.
    quick = ("--duration", "0.2", "--rate", "20", "--watchdog", "40")
    return annelid("loop", "riddle2023-rods", "--pseudo", *quick, "--json")


DONE = {
    "loop": loop,
    "run": typed("run", "riddle2022-planar", "--duration", "0.1", "--no-video"),
    "check": typed("check", "riddle2022-planar"),
    "export-network": typed("export-network", "riddle2022-planar"),
    "new": typed("new", "mine.toml", "--radius", "0.1"),
    "list runs": typed("list", "runs"),
    "show": typed("show", "RUN"),
    "compare": typed("compare", "RUN", "RUN", "-o", "both"),
    "draw": typed("draw", "RUN", "-o", "figure7.svg"),
    "export": typed("export", "RUN", "--to", "csv", "-o", "tables"),
    "study limit-cycle": typed("study", "limit-cycle"),
    "list presets": typed("list", "presets"),
    "list arenas": typed("list", "arenas"),
    "list numbers": typed("list", "numbers"),
    "doctor": typed("doctor"),
    "study load-frame": typed("study", "load-frame", "--displacement", "90"),
    "calibrate": calibrate,
    "sweep": sweep,
    "tune": tune,
} | STUDIED
LISTS = {"check", "list runs", "list presets", "list arenas", "list numbers", "doctor"}
"""What prints a list; all others print an object."""


def commands(group: Any, *above: str) -> Iterator[str]:
    """The names of all commands below a group."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, *above, name)
        else:
            yield " ".join((*above, name))


def strict(text: str) -> Any:
    """Reads one document in which every number is finite."""

    def refuse(name: str) -> None:
        raise AssertionError(name)

    return json.loads(text, parse_constant=refuse)


@pytest.mark.parametrize("name", [name for name in commands(get_command(app)) if name not in ELSEWHERE])
def test_a_command_prints_its_result_as_json_and_nothing_else(
    annelid: Command, finished: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    if name in NO_RESULT:
        assert "No such option: --json" in annelid(*name.split(), "--json").err
        return
    done = DONE[name](annelid, finished, monkeypatch)
    assert done.exit_code == (entry.EXIT_ALL_FAILED if name == "tune" else 0), done.err
    document = strict(done.out)
    assert isinstance(document, list) == (name in LISTS)
    if name in STUDIED:
        assert document["results"]
        assert all(rows == [{**ROWS[0], "drift": None}] for rows in document["results"].values())
    if name not in {*LISTS, "show", "study limit-cycle"}:
        assert document["files"]
        assert document["versions"].keys() == {"annelid", "mujoco-core", "numpy", "python"}


def test_the_page_says_what_every_command_prints() -> None:
    section = PAGE.read_text(encoding="utf-8").split("\n## JSON\n")[1].split("\n## ")[0]
    named = set(re.findall(r"`([a-z0-9]+(?:[ -][a-z0-9-]+)*)", section))
    missing = {name for name in commands(get_command(app)) if name not in named and name.split()[0] != "study"}
    assert not missing - {"paper"}
    assert all(f"| `{key}` |" in section for key in ("files", "results", "versions"))


def test_runs_that_fail_are_in_the_document(annelid: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("annelid.experiment.sweep.sweep_figure", picture)
    Path("study.toml").write_text(STUDY.format(values="1.0, 1e4"))
    done = annelid("sweep", "study.toml", "--json", "--jobs", "1")
    assert done.exit_code == entry.EXIT_SOME_FAILED
    assert "of 2 runs 1 failed" in done.err
    rows = strict(done.out)["results"]["sweep.csv"]
    assert [row["status"] for row in rows] == ["complete", "failed"]
    assert [row["body.gain"] for row in rows] == [1, 10000]
    assert rows[0]["ring_length_min_m"] > 0
    assert rows[1]["ring_length_min_m"] is None


def test_a_run_that_a_guard_stops_has_its_document(annelid: Command) -> None:
    done = annelid("run", "riddle2023-rods", "--set", "guard.kinetic_energy_J=1e-9", "--json", "-o", "here")
    assert done.exit_code == entry.EXIT_STOPPED, done.err
    document = strict(done.out)
    assert document["files"] == [str(Path("here/run.nc"))]
    assert document["results"]["run.nc"]["status"] == "stopped_by_guard"


def test_an_error_is_one_sentence_on_stderr_and_no_document(annelid: Command) -> None:
    done = annelid("run", "nosuch", "--json")
    assert (done.exit_code, done.out) == (entry.EXIT_USAGE, "")
    assert "nosuch" in done.sentence()


def test_json_is_refused_beside_what_prints_something_else(annelid: Command) -> None:
    for words in ("show RUN --verify", "presets wang", "arenas floor", "sweep --example"):
        done = annelid(*words.split(), "--json")
        assert (done.exit_code, done.out) == (entry.EXIT_USAGE, "")
        assert "does not go with" in " ".join(done.err.split())
