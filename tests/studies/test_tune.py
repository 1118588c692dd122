"""Tuning: what may be varied, what the optimisers find, what counts as a gait, and what a search leaves behind."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import log
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.analysis import RhythmScore, Summary
from annelid.analysis.gait import Gait
from annelid.config import load_config
from annelid.errors import ConfigError
from annelid.experiment import store as runs
from annelid.experiment.case import Case
from annelid.experiment.optimisers import optimiser_of
from annelid.experiment.outcome import Outcome
from annelid.experiment.space import Choice, Interval, from_unit, to_unit
from annelid.experiment.store import Store, case_key
from annelid.experiment.tune import (
    OBJECTIVES,
    START,
    Judged,
    Task,
    Trial,
    front,
    judge,
    leader,
    objectives_of,
    parsed_variables,
    search,
    write_gait,
    write_results,
)

pytestmark = pytest.mark.usefixtures("runs_in_this_process")

PRESET = "riddle2023-rods"
GATE, TOLERANCE = "controller.gate_time_constant_ms", "sensor.tolerance_m"
CONFIG = load_config(PRESET)


def a_gait(speed: float = 0.1, cost: float = 1.0, slip: float | None = 0.5, cycles: int = 3) -> Gait:
    return Gait(
        cycles=cycles,
        period_s=2.0,
        speed_m_per_s=speed,
        speed_body_lengths_per_s=speed / 0.75,
        cost_of_transport=cost,
        slip_ratio=slip,
    )


def test_ranges_and_choices_are_read() -> None:
    assert parsed_variables(
        [
            f"{GATE}=80:600:log",
            "sensor.tolerance=0.001:0.02",
            "body.mesh.n_segments=3:6",
            "controller.scheme=euler,heun",
            "body.rings.length_range_m=[0.5,1.0],[0.6,1.1]",
        ],
        CONFIG,
    ) == [
        Interval(GATE, 80.0, 600.0, True),
        Interval(TOLERANCE, 0.001, 0.02),
        Interval("body.mesh.n_segments", 3, 6, whole=True),
        Choice("controller.scheme", ("euler", "heun")),
        Choice("body.rings.length_range_m", ([0.5, 1.0], [0.6, 1.1])),
    ]


def test_what_cannot_be_varied_is_refused_in_a_sentence(subtests: pytest.Subtests) -> None:
    for text, words in (
        (GATE, "says nothing to vary"),
        ("controller.gate_ms=1:2", "did you mean"),
        (f"{GATE}=600:80", "from = 600.0 must be given, and be below to = 80.0"),
        (f"{GATE}=0:80:log", "from = 0 must be above 0 where log = true"),
        ("body.gain=1:2", "unknown field 'body.gain'"),
        (f"{GATE}=-5:80", "gate_time_constant_ms"),
        (f"{GATE}=a:b", "must be numbers"),
        (f"{GATE}=1:2:lin", "only 'log'"),
        (f"{GATE}=300", "one value is no choice"),
        ("body.mesh.n_segments=3.5:6", "whole numbers"),
        ("controller.scheme=1:2", "no number with a range"),
        ("controller.scheme=euler,newton", "controller.scheme"),
    ):
        with subtests.test(f"{text!r:.60}"), pytest.raises(ConfigError, match=words):
            parsed_variables([text], CONFIG)


def test_a_field_is_varied_once() -> None:
    with pytest.raises(ConfigError, match="stands twice"):
        parsed_variables([f"{GATE}=80:600", f"{GATE}=100:200"], CONFIG)


def test_every_controller_has_something_to_tune(subtests: pytest.Subtests) -> None:
    for kind in ("sns", "adaptive", "sns-robust", "sns-pressure", "sns-waiting", "sine", "timed", "shc", "phase-chain"):
        with subtests.test(f"{kind!r:.60}"):
            assert parsed_variables([], load_config(PRESET, {"controller.kind": kind}))


def test_a_program_must_be_told_what_to_vary() -> None:
    program = {"controller": {"kind": "program", "contractions": [{"segment": 1, "start_s": 0.0, "stop_s": 1.0}]}}
    with pytest.raises(ConfigError, match="--vary"):
        parsed_variables([], load_config(PRESET, program))


def test_objectives_are_one_or_two_of_those_known(subtests: pytest.Subtests) -> None:
    for names in (["fast"], ["speed", "speed"], ["speed", "slip", "cost-of-transport"], []):
        with subtests.test(f"{names!r:.60}"), pytest.raises(ConfigError):
            objectives_of(names)


@given(
    share=st.floats(0.0, 1.0),
    ends=st.tuples(st.floats(0.1, 10.0), st.floats(11.0, 1e3)),
    logarithmic=st.booleans(),
    whole=st.booleans(),
)
def test_a_place_in_a_range_and_its_value_are_each_other_s_inverse(
    share: float, ends: tuple[float, float], logarithmic: bool, whole: bool
) -> None:
    low, high = (float(np.ceil(end)) for end in ends) if whole else ends
    variable = Interval("x", low, high, logarithmic, whole)
    value = from_unit(variable, share)
    assert value in variable
    assert isinstance(value, int) == whole
    rounding = 0.5 if whole else 1e-3 * value
    exact = low * (high / low) ** share if logarithmic else low + share * (high - low)
    assert abs(value - exact) <= rounding
    assert from_unit(variable, to_unit(variable, value)) == pytest.approx(value, rel=1e-3)


VALLEY = (Interval("a", 1.0, 100.0, logarithmic=True), Interval("b", -1.0, 1.0))


def test_numbers_and_one_objective_are_for_the_evolution_strategy() -> None:
    choice = Choice("c", (1, 2))
    assert "cma_es" in repr(optimiser_of(VALLEY, 1, None, 0))
    for variables, n_objectives in (((*VALLEY, choice), 1), (VALLEY, 2), (VALLEY[:1], 1)):
        assert "parzen" in repr(optimiser_of(variables, n_objectives, None, 0))


class Toy(Store):
    """Runs whose speed is largest, 1 m/s, at a gate of 200 ms and a tolerance of 5 mm, and which slip with the gate."""

    def __init__(self, refused: str = "") -> None:
        super().__init__(Path("nowhere"))
        self._refused = refused

    def compute(self, cases: Any, stage: str = "", *, failed: Any = None, **_: Any) -> Mapping[str, Outcome]:
        found = {}
        for case in cases:
            if self._refused and self._refused in case.command:
                failed[case_key(case)] = ConfigError("no design rule has a solution")
            else:
                gate, tolerance = case.config.controller.gate_time_constant_ms, case.config.sensor.tolerance_m
                speed = 1.0 - log(gate / 200.0) ** 2 - (tolerance / 0.005 - 1.0) ** 2
                gait = a_gait(speed, slip=gate / 600.0)
                found[case_key(case)] = replace(an_outcome(), path=self.path(case), gait=gait)
        return found


def toy_task(n_trials: int = 40, objectives: Sequence[str] = ("speed",), seed: int = 0) -> Task:
    variables = parsed_variables([f"{GATE}=80:600:log", f"{TOLERANCE}=0.001:0.02"], CONFIG)
    return Task(PRESET, {"duration_s": 1.0}, variables, objectives_of(list(objectives)), n_trials, seed)


def trials_of(task: Task) -> list[Trial]:
    return [trial for generation in search(task, Toy()) for trial in generation]


def test_a_search_finds_the_best_gait_and_states_the_start() -> None:
    # A hundred for each variable, as is usual for a CMA-ES.
    task = toy_task(200)
    found = trials_of(task)
    assert [trial.number for trial in found] == [START, *range(200)]
    assert found[0].case == Case(PRESET, {"duration_s": 1.0})
    best = leader(found, [OBJECTIVES["speed"]])
    assert best is not None
    # A twentieth of each range from the best gait, as `to_unit` counts.
    for variable, optimum in zip(task.variables, (200.0, 0.005), strict=True):
        assert isinstance(variable, Interval)
        assert abs(to_unit(variable, best.values[variable.field]) - to_unit(variable, optimum)) < 0.05
    assert best.case.changes == {"duration_s": 1.0, **best.values}


@pytest.mark.parametrize("objectives", [("speed",), ("speed", "slip")])
def test_a_longer_search_begins_as_the_shorter_one(objectives: tuple[str, ...]) -> None:
    """So a search that is called again, with more trials too, finds its runs in the store."""
    short, long = trials_of(toy_task(13, objectives)), trials_of(toy_task(30, objectives))
    assert long[: len(short)] == short
    assert trials_of(toy_task(13, objectives, seed=1))[1:] != short[1:]


def test_two_objectives_give_a_front_between_their_best() -> None:
    task = toy_task(60, ("speed", "slip"))
    found = trials_of(task)
    on_front = front(found, task.objectives)
    speeds = [trial.judged.value(OBJECTIVES["speed"]) for trial in on_front]
    slips = [trial.judged.value(OBJECTIVES["slip"]) for trial in on_front]
    assert len(on_front) > 3
    assert speeds == sorted(speeds, reverse=True)
    assert slips == sorted(slips, reverse=True)
    assert leader(found, task.objectives) in on_front


def test_a_worm_that_cannot_be_built_is_a_trial_with_the_penalty() -> None:
    task = toy_task(8)
    others = trials_of(task)
    refused = others[3]
    store = Toy(refused=f"{GATE}={refused.values[GATE]:g}")
    found = [trial for generation in search(task, store) for trial in generation]
    assert found[3].judged == Judged(None, "cannot be built: no design rule has a solution")
    assert found[3].judged.value(OBJECTIVES["speed"]) == 0.0
    assert [trial.judged for trial in found if trial.number != 2] == [one.judged for one in others if one.number != 2]


@given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), min_size=1, max_size=12))
def test_the_front_has_all_that_nothing_beats_and_nothing_else(pairs: list[tuple[int, int]]) -> None:
    objectives = objectives_of(["speed", "slip"])
    found = [
        Trial(i, {}, Case(PRESET), Judged(a_gait(1.0 + speed, slip=float(slip)), ""), Path(str(i)))
        for i, (speed, slip) in enumerate(pairs)
    ]
    members = {trial.number for trial in front(found, objectives)}
    for i, (speed, slip) in enumerate(pairs):
        beaten = any(a >= speed and b <= slip and (a, b) != (speed, slip) for a, b in pairs)
        assert (i in members) != beaten


def test_a_run_is_on_the_front_once() -> None:
    twice = [Trial(i, {}, Case(PRESET), Judged(a_gait(), ""), Path("same")) for i in (START, 0)]
    assert [trial.number for trial in front(twice, objectives_of(["speed", "slip"]))] == [START]


def an_outcome(message: str = "", **changes: Any) -> Outcome:
    """Of a run in order, but for changes of the rhythm and for why it was stopped."""
    summary = Summary(**dict.fromkeys(Summary.__dataclass_fields__))  # type: ignore[arg-type]
    rhythm = RhythmScore("ordered", "a wave", (1, 2, 3), 1.0, 0.0, 1.0, 1, 1, 1.0, 1.0)
    return Outcome(Path(), summary, replace(rhythm, **changes), (), message)


def test_what_does_not_walk_is_told_why_and_penalised(subtests: pytest.Subtests) -> None:
    for outcome, gait, words in (
        (an_outcome(), a_gait(), ""),
        (an_outcome(verdict="disordered", reason="regular but not a wave"), a_gait(), ""),
        (an_outcome(verdict="disordered", reason="limps"), a_gait(), "out of order: limps"),
        (an_outcome(verdict="silent", reason="stalled"), a_gait(), "silent: stalled"),
        (an_outcome(message="energy ran away"), a_gait(), "stopped: energy ran away"),
        (an_outcome(), a_gait(cycles=1), "fewer than 2 complete cycles"),
        (an_outcome(), Gait(), "fewer than 2 complete cycles"),
        (an_outcome(), a_gait(speed=-0.1), "does not advance"),
        (an_outcome(), a_gait(speed=float("nan")), "does not advance"),
    ):
        with subtests.test(f"{outcome!r:.60}"):
            judged = judge(replace(outcome, gait=gait))
            assert judged.problem == words
            assert (judged.gait is None) == bool(outcome.message)
            for objective in OBJECTIVES.values():
                assert (judged.value(objective) == objective.penalty) == bool(words)


@pytest.mark.parametrize(
    ("share", "work_J", "says"),
    [(0.29, 5.0, ""), (0.31, 5.0, "took 31%"), (-0.4, 5.0, "added 40%"), (None, 0.0, ""), (1e6, 1e-6, "")],
)
def test_a_gait_that_lives_on_the_integrator_is_none_where_that_is_asked(
    share: float | None, work_J: float, says: str
) -> None:
    energy: Any = SimpleNamespace(numerical_share=share, muscle_work_J=work_J)
    walking = replace(an_outcome(), gait=replace(a_gait(), energy=energy))
    assert judge(walking).problem == ""
    found = judge(walking, 0.3)
    assert says in found.problem
    assert found.value(OBJECTIVES["speed"]) == (0.0 if says else 0.1)


def test_the_best_gait_is_a_file_that_makes_the_same_run(tmp_path: Path) -> None:
    task = toy_task(20)
    found = trials_of(task)
    write_results(task, found, "annelid tune", tmp_path)
    best = leader(found, [OBJECTIVES["speed"]])
    assert best is not None
    ours, theirs = (config.model_dump() for config in (load_config(tmp_path / "best.toml"), best.case.config))
    for tree in (ours, theirs):
        del tree["name"], tree["summary"], tree["record"]
    assert ours == theirs
    for name in ("tuning.png", "tuning.svg"):
        assert (tmp_path / name).stat().st_size > 1000


def test_a_gait_tuned_from_a_file_extends_that_file(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(f'extends = "{PRESET}"\nsensor.noise_m = 0.001\n')
    task = replace(toy_task(8), source=str(tmp_path / "mine.toml"))
    trial = trials_of(task)[4]
    write_gait(task, trial, "annelid tune", tmp_path / "gait.toml")
    assert load_config(tmp_path / "gait.toml").sensor == trial.case.config.sensor
    assert trial.case.stem == "mine"


def test_every_trial_is_a_row_with_its_values_and_numbers(tmp_path: Path) -> None:
    task = toy_task(16, ("speed", "slip"))
    found = trials_of(task)
    write_results(task, found, "annelid tune", tmp_path)
    rows = list(csv.DictReader((tmp_path / "trials.csv").open()))
    assert [row["trial"] for row in rows] == ["start", *map(str, range(16))]
    for row, trial in zip(rows, found, strict=True):
        for field, value in trial.values.items():
            assert float(row[field]) == pytest.approx(value)
        assert trial.judged.gait is not None
        assert float(row["speed_m_per_s"]) == pytest.approx(trial.judged.gait.speed_m_per_s, rel=1e-3)
        assert row["problem"] == trial.judged.problem


def test_a_second_search_computes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    task = replace(toy_task(2), changes={"duration_s": 0.4})
    folder = tmp_path / "runs"
    first = [trial for generation in search(task, Store(folder)) for trial in generation]
    assert {trial.judged.problem for trial in first} == {"out of order: too short: fewer than two cycles"}
    monkeypatch.setattr(runs, "attempt", None)
    assert [trial for generation in search(task, Store(folder)) for trial in generation] == first
