"""Tuning: what may be varied, what the optimiser finds, what counts as a gait, and what a search leaves behind."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import log
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.analysis import RhythmScore, Summary
from annelid.config import load_config
from annelid.errors import ConfigError
from annelid.experiment import store as runs
from annelid.experiment.case import Case
from annelid.experiment.gait_criteria import Judged, judge
from annelid.experiment.outcome import Outcome
from annelid.experiment.search_space import Choice, Interval, from_unit
from annelid.experiment.store import Store, case_key
from annelid.experiment.tune import (
    OBJECTIVES,
    Task,
    Trial,
    front,
    leader,
    objectives_of,
    parsed_variables,
    search,
    write_gait,
    write_results,
)
from outcome import Command

pytestmark = pytest.mark.usefixtures("runs_in_this_process")

PRESET = "riddle2023-rods"
GATE, TOLERANCE = "controller.gate_time_constant_ms", "sensor.tolerance_m"
CONFIG = load_config(PRESET)
SPEED, SLIP = OBJECTIVES["speed"], OBJECTIVES["slip"]


def a_gait(speed: float = 0.1, slip: float = 0.5, cycles: int = 3) -> Summary:
    return Summary(cycles=cycles, gait_period_s=2.0, speed_m_per_s=speed, cost_of_transport=1.0, slip_ratio=slip)


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
        ("body.gain=1:2", "unknown field 'body.gain'"),
        (f"{GATE}=-5:80", "gate_time_constant_ms"),
        (f"{GATE}=a:b", "must be numbers"),
        (f"{GATE}=1:2:lin", "only 'log'"),
        (f"{GATE}=300", "one value is no choice"),
        ("controller.scheme=euler,newton", "controller.scheme"),
    ):
        with subtests.test(text), pytest.raises(ConfigError, match=words):
            parsed_variables([text], CONFIG)


def test_every_controller_has_something_to_tune_but_a_program(subtests: pytest.Subtests) -> None:
    for kind in ("sns", "adaptive", "sns-robust", "sns-pressure", "sine", "timed", "shc", "phase-chain"):
        with subtests.test(kind):
            assert parsed_variables([], load_config(PRESET, {"controller.kind": kind}))
    program = {"controller": {"kind": "program", "contractions": [{"segment": 1, "start_s": 0.0, "stop_s": 1.0}]}}
    with pytest.raises(ConfigError, match="--vary"):
        parsed_variables([], load_config(PRESET, program))


def test_objectives_are_one_or_two_of_those_known(subtests: pytest.Subtests) -> None:
    for names in (["fast"], ["speed", "speed"], ["speed", "slip", "cost-of-transport"], []):
        with subtests.test(f"{names}"), pytest.raises(ConfigError):
            objectives_of(names)


@given(
    share=st.floats(0.0, 1.0),
    ends=st.tuples(st.integers(1, 10), st.integers(11, 1000)),
    logarithmic=st.booleans(),
    whole=st.booleans(),
)
def test_a_place_in_a_range_has_its_value_to_four_digits(
    share: float, ends: tuple[int, int], logarithmic: bool, whole: bool
) -> None:
    low, high = ends
    variable = Interval("x", low, high, logarithmic, whole)
    value = from_unit(variable, share)
    assert value in variable
    assert isinstance(value, int) == whole
    exact = low * (high / low) ** share if logarithmic else low + share * (high - low)
    assert abs(value - exact) <= (0.5 if whole else 1e-3 * value)


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
                found[case_key(case)] = replace(an_outcome(), path=self.path(case), summary=gait)
        return found


def toy_task(n_trials: int = 40, objectives: Sequence[str] = ("speed",), seed: int = 0) -> Task:
    variables = parsed_variables([f"{GATE}=80:600:log", f"{TOLERANCE}=0.001:0.02"], CONFIG)
    return Task(PRESET, {"duration_s": 1.0}, variables, objectives_of(list(objectives)), n_trials, seed)


def trials_of(task: Task, store: Store | None = None) -> list[Trial]:
    return [trial for generation in search(task, store or Toy()) for trial in generation]


def test_a_search_finds_the_best_gait_and_states_the_start() -> None:
    found = trials_of(toy_task(100))
    assert [trial.name for trial in found] == ["start", *map(str, range(100))]
    assert found[0].case == Case(PRESET, {"duration_s": 1.0})
    best = leader(found, [SPEED])
    assert best is not None
    # A twentieth of each range from the best gait, of the gates' in the logarithm.
    assert abs(log(best.values[GATE] / 200.0)) < 0.05 * log(600.0 / 80.0)
    assert abs(best.values[TOLERANCE] - 0.005) < 0.05 * 0.019
    assert best.case.changes == {"duration_s": 1.0, **best.values}


@pytest.mark.parametrize("objectives", [("speed",), ("speed", "slip")])
def test_a_longer_search_begins_as_the_shorter_one(objectives: tuple[str, ...]) -> None:
    """So a search that is called again, with more trials too, finds its runs in the store."""
    short, long = trials_of(toy_task(21, objectives)), trials_of(toy_task(30, objectives))
    assert long[: len(short)] == short
    assert trials_of(toy_task(8, objectives, seed=1))[1:] != short[1:9]


def test_choices_and_whole_numbers_are_searched_from_any_start() -> None:
    texts = [f"{GATE}=80:600:log", "body.mesh.n_segments=4:6", "body.rings.length_range_m=[0.5,1.0],[0.6,1.1]"]
    found = trials_of(replace(toy_task(9), variables=parsed_variables(texts, CONFIG)))
    segments = {trial.values["body.mesh.n_segments"] for trial in found[1:]}
    assert segments <= {4, 5, 6}
    assert all(isinstance(one, int) for one in segments)
    ranges = [trial.values["body.rings.length_range_m"] for trial in found[1:]]
    assert all(one in ([0.5, 1.0], [0.6, 1.1]) for one in ranges)


def test_a_worm_that_cannot_be_built_is_a_trial_with_the_penalty() -> None:
    others = trials_of(toy_task(8))
    found = trials_of(toy_task(8), Toy(refused=f"{GATE}={others[3].values[GATE]:g}"))
    assert found[3].judged == Judged(None, "cannot be built: no design rule has a solution")
    assert SPEED.value(found[3].judged) == 0.0
    assert [one.judged for one in found if one is not found[3]] == [
        one.judged for one in others if one is not others[3]
    ]


@given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), min_size=1, max_size=12))
def test_the_front_has_all_that_nothing_beats_and_nothing_else(pairs: list[tuple[int, int]]) -> None:
    found = [
        Trial(str(i), {}, Case(PRESET), Judged(a_gait(1.0 + speed, slip=float(slip)), ""), Path(str(i)))
        for i, (speed, slip) in enumerate(pairs)
    ]
    on_front = front(found, [SPEED, SLIP])
    members = {int(trial.name) for trial in on_front}
    assert leader(found, [SPEED, SLIP]) in on_front
    for i, (speed, slip) in enumerate(pairs):
        beaten = any(a >= speed and b <= slip and (a, b) != (speed, slip) for a, b in pairs)
        assert (i in members) != beaten


def test_a_run_is_on_the_front_once() -> None:
    twice = [Trial(name, {}, Case(PRESET), Judged(a_gait(), ""), Path("same")) for name in ("start", "0")]
    assert [trial.name for trial in front(twice, [SPEED, SLIP])] == ["start"]


def an_outcome(message: str = "", **changes: Any) -> Outcome:
    """Of a run in order, but for changes of the rhythm and for why it was stopped."""
    rhythm = RhythmScore("ordered", "a wave", (1, 2, 3), 1.0, 0.0, 1.0, 1, 1, 1.0, 1.0)
    return Outcome(Path(), Summary(), replace(rhythm, **changes), (), message)


def test_what_does_not_walk_is_told_why_and_penalised(subtests: pytest.Subtests) -> None:
    for outcome, gait, words in (
        (an_outcome(), a_gait(), ""),
        (an_outcome(verdict="disordered", reason="regular but not a wave"), a_gait(), ""),
        (an_outcome(verdict="disordered", reason="limps"), a_gait(), "out of order: limps"),
        (an_outcome(verdict="silent", reason="stalled"), a_gait(), "silent: stalled"),
        (an_outcome(message="energy ran away"), a_gait(), "stopped: energy ran away"),
        (an_outcome(), a_gait(cycles=1), "fewer than 2 complete cycles"),
        (an_outcome(), a_gait(speed=-0.1), "does not advance"),
        (an_outcome(), a_gait(speed=float("nan")), "does not advance"),
    ):
        with subtests.test(words):
            judged = judge(replace(outcome, summary=gait))
            assert judged.problem == words
            assert (judged.gait is None) == bool(outcome.message)
            for objective in OBJECTIVES.values():
                assert (objective.value(judged) == objective.penalty) == bool(words)


def test_a_gait_that_lives_on_the_integrator_is_none_where_that_is_asked(subtests: pytest.Subtests) -> None:
    for share, work_J, says in (
        (0.29, 5.0, ""),
        (0.31, 5.0, "took 31%"),
        (-0.4, 5.0, "added 40%"),
        (None, 0.0, ""),
        (1e6, 1e-6, ""),
    ):
        with subtests.test(says):
            gait = replace(a_gait(), energy_numerical_share=share, energy_muscle_work_J=work_J)
            walking = replace(an_outcome(), summary=gait)
            assert judge(walking).problem == ""
            assert says in (found := judge(walking, 0.3)).problem
            assert SPEED.value(found) == (0.0 if says else 0.1)


def test_a_search_leaves_every_trial_as_a_row_and_the_best_gait_as_a_file_that_runs(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(f'extends = "{PRESET}"\nsensor.noise_m = 0.001\n')
    task = replace(toy_task(16, ("speed", "slip")), source=str(tmp_path / "mine.toml"))
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
    for name in ("tuning.png", "tuning.svg"):
        assert (tmp_path / name).stat().st_size > 1000
    on_front = front(found, task.objectives)
    assert {path.stem for path in (tmp_path / "front").iterdir()} == {trial.name for trial in on_front}
    best = leader(found, task.objectives)
    assert best is not None
    ours, theirs = (config.model_dump() for config in (load_config(tmp_path / "best.toml"), best.case.config))
    for tree in (ours, theirs):
        del tree["name"], tree["summary"], tree["record"]
    assert ours == theirs


def test_a_second_search_computes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    task = replace(toy_task(2), changes={"duration_s": 0.4})
    first = trials_of(task, Store(tmp_path / "runs"))
    assert {trial.judged.problem for trial in first} == {"out of order: too short: fewer than two cycles"}
    monkeypatch.setattr(runs, "attempt", None)
    assert trials_of(task, Store(tmp_path / "runs")) == first
    write_gait(task, first[1], "annelid tune", tmp_path / "gait.toml")
    assert load_config(tmp_path / "gait.toml").sensor == first[1].case.config.sensor


def test_bad_input_ends_in_one_sentence_before_anything_runs(annelid: Command, subtests: pytest.Subtests) -> None:
    for arguments, says in (
        (("--objective", "pace"), "unknown objective 'pace'"),
        (("--vary", "arena.friction=1:0.5"), "be below to = 0.5"),
        (("--set", "controller.kind=pogram"), "controller.kind = 'pogram'"),
        (("crawlr",), "unknown preset 'crawlr'"),
    ):
        with subtests.test(says):
            done = annelid("tune", *arguments)
            assert done.exit_code == 2
            assert says in done.sentence()
            assert not list(Path().iterdir())
