from __future__ import annotations

import shlex
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.config import RunConfig, load_config, parse_assignments
from annelid.experiment.case import Case
from annelid_studies.standard_cases import CHAIN, PLANAR, RODS, chain, fast, rods


def typed(command: str) -> RunConfig:
    """What a shell and the command line make of a command."""
    program, run, preset, *words = shlex.split(command)
    assert (program, run) == ("annelid", "run")
    assert words[::2] == ["--set"] * (len(words) // 2)
    return load_config(preset, parse_assignments(words[1::2]))


def assert_same_run(case: Case) -> None:
    assert typed(case.command).model_dump(exclude={"record"}) == case.config.model_dump(exclude={"record"})


@settings(max_examples=20)
@given(
    friction=st.floats(0.01, 2.0),
    noise=st.floats(0.0, 0.01),
    seed=st.integers(0, 2**31),
    tension_only=st.booleans(),
    gate_start=st.sampled_from(["steady", "toolbox"]),
)
def test_a_command_makes_the_run_of_its_case(
    friction: float, noise: float, seed: int, tension_only: bool, gate_start: str
) -> None:
    changes = {
        "arena.friction": friction,
        "sensor.noise_m": noise,
        "seed": seed,
        "controller.gate_start": gate_start,
        "body.springs.tension_only": tension_only,
    }
    for case in (rods(changes), fast(changes), chain(changes)):
        assert_same_run(case)


def test_recording_is_sparse_unless_the_case_says_otherwise() -> None:
    case = Case(CHAIN, {"duration_s": 5.0})
    sparse, usual = case.config.record, load_config(CHAIN).record
    assert sparse.signals_interval_s > usual.signals_interval_s
    assert sparse.frames_interval_s > 10 * usual.frames_interval_s
    own = case.but({"record.frames_interval_s": 0.1}).config.record
    assert own.frames_interval_s == 0.1
    assert own.signals_interval_s == usual.signals_interval_s


def test_further_changes_win() -> None:
    case = Case(RODS, {"seed": 1, "arena.friction": 0.3}).but({"seed": 2})
    assert (case.config.seed, case.preset) == (2, RODS)
    assert case.command == f"annelid run {RODS} --set seed=2 --set arena.friction=0.3"


def test_costs_order_the_runs_by_their_work() -> None:
    costs = [case.cost_s for case in (Case(PLANAR), rods(), chain(), Case(CHAIN))]
    assert all(less < more for less, more in pairwise(costs))
    assert rods({"duration_s": 10.0}).cost_s == pytest.approx(2 * rods({"duration_s": 5.0}).cost_s)
