"""Identification from a walk, of a small machine that switches as a worm does, one step of its clock at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from annelid.body.worm import WormBody
from annelid.config import RunConfig
from annelid_lab.calibration.intervals import intervals
from annelid_lab.calibration.kinds.walk import Walk, WalkTest
from annelid_lab.calibration.report import Identified, identify
from annelid_lab.calibration.simulations import Simulations
from annelid_lab.calibration.study import ROBOT, load_identify_study

STEP_S, DURATION_S = 0.006, 6.0
GIVEN_DAMPING_S = 0.145
"""Of the preset."""
TRUTH = {"young_modulus": 0.22e9, "damping_time": 0.1}


def walk(young: float, damping: float, stiffer: tuple[float, ...] = (1.0, 1.0, 1.0)) -> NDArray[np.float64]:
    """Three masses on springs, pulled in turn; the next one is pulled when the last is short. Lengths, m."""
    stiffness = young / 0.22e9 * np.array(stiffer)
    square, pull = 16.0 * stiffness, 0.06 / stiffness
    length, speed, active = np.full(3, 0.06), np.zeros(3), 0
    lengths = np.empty((round(DURATION_S / STEP_S) + 1, 3))
    for row in lengths:
        row[:] = length
        active = (active + (length[active] < 0.03)) % 3
        rest = 0.06 - pull * (np.arange(3) == active)
        speed = (speed + STEP_S * square * (rest - length)) / (1.0 + STEP_S * square * (damping + STEP_S))
        length = length + STEP_S * speed
    return lengths.T


def stand_in(test: WalkTest, config: RunConfig) -> dict[str, NDArray[Any]]:
    body = config.body
    assert isinstance(body, WormBody)
    return machine(body.strands.one_number("young_modulus_Pa"), body.strands.damping_time_s)


def machine(young: float, damping: float) -> dict[str, NDArray[Any]]:
    found: dict[str, NDArray[Any]] = {}
    for i, values in enumerate(walk(young, damping)):
        found |= {f"time_{i}": STEP_S * np.arange(len(values)), f"value_{i}": values, f"unit_{i}": np.array("m")}
    return found


def identified(
    folder: Path, lengths: NDArray[np.float64], span_s: float = 5.4, free: Sequence[str] = (), **more: Any
) -> Identified:
    rng, clock = np.random.default_rng(1), np.arange(0.0, span_s, 0.02)
    columns = {"t_s": clock}
    for i, values in enumerate(lengths):
        own = np.interp(clock + 0.5, STEP_S * np.arange(len(values)), values)
        columns[f"s{i + 1}_mm"] = 1e3 * (own + rng.normal(0.0, 5e-4, len(clock)))
    table, head = np.column_stack([*columns.values()]), ",".join(columns)
    np.savetxt(folder / "robot.csv", table, delimiter=",", header=head, comments="")
    rows = [f's{i}_mm = "stretch_length[{i}, mean]"' for i in (1, 2, 3)]
    (folder / "map.toml").write_text("\n".join(['time = "t_s"', "[map]", *rows]))
    study = {
        "preset": "riddle2023-rods",
        "set": {"duration_s": DURATION_S},
        "parameters": {"young_modulus": {"start": 3e8}, "damping_time": {"start": 0.145}, **more},
        "experiments": [{"kind": "walk", "name": "walk", "data": "robot.csv", "map": "map.toml"}],
    }
    loaded = load_identify_study(study)
    return identify(loaded.only(free) if free else loaded, folder, Simulations())


@pytest.fixture(autouse=True)
def _machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(WalkTest, "run", stand_in)


@pytest.mark.parametrize("truth", [(0.22e9, 0.1), (0.275e9, 0.08)], ids=["near", "an optimum at a region's edge"])
def test_a_walk_that_switches_in_steps_gives_the_truth_and_intervals_that_hold_it(
    tmp_path: Path, truth: tuple[float, float]
) -> None:
    found = identified(tmp_path, walk(*truth))
    assert [*found.fit.values.values()] == pytest.approx(truth, rel=0.01)
    ends = found.intervals.profile
    assert ((ends[:, 0] < truth) & (truth < ends[:, 1])).all()
    assert (ends[:, 1] / ends[:, 0] < 1.05).all()
    (part,) = found.fit.parts
    assert part.data.unit == "m"
    tried = [found.fit.emulator.model.measured(one)[0] for one in found.fit.emulator.model.tried]
    best = min(float(np.sqrt(((one - part.data.values) ** 2).mean())) for one in tried)
    assert part.rms < 1.05 * best, "no worm that was computed is much better than the one that is kept"
    assert part.numbers["lag_s"] == pytest.approx(0.5, abs=0.005)
    assert found.fit.n_tests < 70
    assert not found.warnings
    aside = replace(found.fit, logs=found.fit.logs + 0.3)
    assert (intervals(aside, found.fit.emulator.model).profile[:, 1] >= np.exp(aside.logs)).all(), "a value is inside"


def test_the_last_cycles_of_every_signal_are_held_out() -> None:
    walk = Walk(name="walk", data="walk.csv", map="walk.map.toml", hold_out=((0.6, 1.0),))
    data = walk.read(ROBOT.parent)
    assert np.array_equal(walk.held(data), data.at >= 0.6 * np.ptp(data.source.log.time_s))
    assert set(data.series[walk.held(data)]) == {0, 1, 2}


def test_lag_and_clock_of_a_walk_that_is_held_out_are_those_of_its_log(tmp_path: Path) -> None:
    clock, run_s = np.arange(0.0, 4.0, 0.02), np.arange(0.0, 6.0, 0.02)
    table = np.column_stack([clock, 80.0 + 20.0 * np.sin(2.0 * (clock + 0.7))])
    np.savetxt(tmp_path / "walk.csv", table, delimiter=",", header="t_s,s1_mm", comments="")
    (tmp_path / "map.toml").write_text('time = "t_s"\n[map]\ns1_mm = "stretch_length[1, mean]"')
    walk = Walk(name="walk", data="walk.csv", map="map.toml", hold_out=((0.0, 1.0),))
    data = walk.read(tmp_path)
    assert walk.held(data).all()
    lag_s, _ = walk.alignment(data, {"time_0": run_s, "value_0": 0.08 + 0.02 * np.sin(2.0 * run_s)})
    assert lag_s == pytest.approx(0.7, abs=0.005)


def test_a_cable_force_counts_as_much_as_a_length(tmp_path: Path) -> None:
    clock = np.arange(0.0, 4.0, 0.02)
    table = np.column_stack([clock, 80.0 + 20.0 * np.sin(clock), 15.0 + 5.0 * np.cos(clock)])
    np.savetxt(tmp_path / "walk.csv", table, delimiter=",", header="t_s,s1_mm,f1_N", comments="")
    rows = ('time = "t_s"', "[map]", 's1_mm = "stretch_length[1, mean]"', 'f1_N = "muscle_force[ring_0]"')
    (tmp_path / "map.toml").write_text("\n".join(rows))
    data = Walk(name="walk", data="walk.csv", map="map.toml").read(tmp_path)
    assert data.unit == "of its standard deviation"
    assert [data.values[data.series == signal].std() for signal in (0, 1)] == pytest.approx([1.0, 1.0], rel=0.01)


def test_a_segment_of_other_stiffness_is_noticed(tmp_path: Path) -> None:
    found = identified(tmp_path, walk(TRUTH["young_modulus"], TRUTH["damping_time"], stiffer=(1.0, 1.2, 1.0)))
    assert any("model lacks something" in sentence for sentence in found.warnings)


@pytest.mark.parametrize(
    ("rows", "says"),
    [(range(60), "the log has 1.0 cycles"), ((*range(80), *range(190, 270)), "nothing was logged for")],
)
def test_half_a_walk_and_a_gap_are_noticed(tmp_path: Path, rows: Sequence[int], says: str) -> None:
    lines = ROBOT.with_name("walk.csv").read_text().splitlines(keepends=True)
    (tmp_path / "walk.csv").write_text(lines[0] + "".join(lines[1 + row] for row in rows))
    (tmp_path / "map.toml").write_bytes(ROBOT.with_name("walk.map.toml").read_bytes())
    log = Walk(name="walk", data="walk.csv", map="map.toml")
    (sentence,) = log.doubts(log.read(tmp_path), machine(*TRUTH.values()))
    assert says in sentence


def test_another_robot_is_noticed(tmp_path: Path) -> None:
    found = identified(tmp_path, walk(0.22e9, GIVEN_DAMPING_S)[:, ::-1], free=("young_modulus",))
    assert any("another robot or gait" in sentence for sentence in found.warnings)


def test_a_parameter_that_moves_nothing_gets_no_interval_and_spoils_none(tmp_path: Path) -> None:
    nothing = {"start": 0.5, "low": 0.1, "high": 2.0, "fields": {"arena.friction": 1.0}}
    found = identified(tmp_path, walk(0.22e9, GIVEN_DAMPING_S), free=("young_modulus", "floor"), floor=nothing)
    assert any("do not determine floor" in sentence for sentence in found.warnings)
    assert found.intervals.profile[1] == pytest.approx([0.1, 2.0])
    assert found.fit.values["young_modulus"] == pytest.approx(0.22e9, rel=0.01)


def test_another_worm_that_fits_as_well_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine that cannot tell a stiffness from its mirror image at 0.3 GPa."""

    def folded(test: WalkTest, config: RunConfig) -> dict[str, NDArray[Any]]:
        body = config.body
        assert isinstance(body, WormBody)
        young = 0.3e9 * np.exp(-abs(np.log(body.strands.one_number("young_modulus_Pa") / 0.3e9)))
        return machine(young, TRUTH["damping_time"])

    monkeypatch.setattr(WalkTest, "run", folded)
    found = identified(tmp_path, walk(TRUTH["young_modulus"], TRUTH["damping_time"]), free=("young_modulus",))
    value = found.fit.values["young_modulus"]
    mirrored = 0.3e9**2 / value
    (sentence,) = [one for one in found.warnings if "fits as well" in one or "fits nearly as well" in one]
    assert float(sentence.split(" = ")[1].split()[0]) == pytest.approx(mirrored, rel=0.01)
