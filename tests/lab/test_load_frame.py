"""The measured loop, friction of its cable, and the virtual load frame."""

from __future__ import annotations

from math import exp
from pathlib import Path

import mujoco
import numpy as np
import pytest

from annelid.body.actuators.servo import wrap_factors
from annelid.config import load_config
from annelid.errors import AnnelidError, ConfigError, SimulationStopped
from annelid_lab.calibration import Loop, cable_force, frame, load_frame, read_loop

LOADING_N = [4.60, 6.16, 7.46, 9.55, 9.82, 11.49, 11.54, 12.17, 13.64, 14.27]
UNLOADING_N = [-0.67, -0.06, 0.04, 0.42, 0.72, 0.89, 0.66, 0.91, 1.25, 2.01]
RODS = {
    "body.strands.radius_m": 0.00299,
    "body.strands.young_modulus_Pa": 1e9,
    "body.strands.shear_modulus_Pa": 1e9 / 1.5,
}


def triangle(force_in: float, force_out: float, n: int = 200) -> Loop:
    x = np.concatenate([np.linspace(0, 0.3, n), np.linspace(0.3, 0, n)[1:]])
    return Loop(x, np.where(np.arange(len(x)) < n, force_in, force_out))


def test_the_measured_loop_is_the_one_of_the_load_frame() -> None:
    loop = read_loop()
    assert len(loop.force_N) == 6668
    assert loop.turn == 3318
    assert loop.displacement_m.max() == pytest.approx(0.330, abs=1e-4)
    at = np.arange(0.002, 0.3011, 0.002)
    force = loop.branches(at)[:, 14::15]
    assert force == pytest.approx(np.array([LOADING_N, UNLOADING_N]), abs=0.1)
    assert loop.lost_share() == pytest.approx(0.91, abs=0.005)


def test_work_of_a_loop_of_two_constant_forces() -> None:
    loop = triangle(5.0, 2.0)
    done, back = loop.work_J()
    assert done == pytest.approx(1.5, rel=0.01)
    assert back == pytest.approx(0.6, rel=0.02)
    assert loop.branches(np.array([0.1, 0.12])) == pytest.approx(np.array([[5.0, 5.0], [2.0, 2.0]]))


def test_a_place_that_a_loop_does_not_reach_is_refused() -> None:
    with pytest.raises(AnnelidError, match="no sample near 400 mm"):
        triangle(1.0, 1.0).branches(np.array([0.4, 0.5]))


@pytest.mark.parametrize(
    ("text", "says"),
    [("1,2\n2,x\n", "no table of numbers"), ("1\n2\n1\n", "1 column"), ("1,2\n2,3\n", "there and back")],
)
def test_a_file_that_is_no_loop_is_refused(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "loop.csv"
    path.write_text(text)
    with pytest.raises(AnnelidError, match=says):
        read_loop(path)


def test_cable_friction_is_that_of_a_sliding_cable(subtests: pytest.Subtests) -> None:
    """Tension along the wrap integrated numerically, from the pulled end and towards it."""
    for friction in (1e-3, 0.5, 1.4, 3.0):
        with subtests.test(f"{friction!r:.60}"):
            along = np.linspace(0.0, 1.0, 20_001)
            inwards, outwards = wrap_factors(friction)
            assert 1.0 / inwards == pytest.approx(np.trapezoid(np.exp(-friction * along), along), rel=1e-6)
            assert 1.0 / outwards == pytest.approx(np.trapezoid(np.exp(friction * along), along), rel=1e-6)
            assert inwards / outwards == pytest.approx(exp(friction))


def test_a_cable_without_friction_changes_nothing() -> None:
    loop = triangle(5.0, 2.0)
    assert np.array_equal(cable_force(loop, 0.0).force_N, loop.force_N)
    with pytest.raises(AnnelidError, match="at least 0"):
        cable_force(loop, -1.0)


@pytest.fixture(scope="module")
def smooth() -> Loop:
    return load_frame(load_config("riddle2023-rods", RODS), displacement_m=0.2)


AT_M = np.arange(0.02, 0.181, 0.02)


def test_the_frame_winds_the_ring_in_and_out(smooth: Loop) -> None:
    assert smooth.displacement_m[0] == 0.0
    assert smooth.displacement_m.max() == pytest.approx(0.2, abs=0.002)
    assert abs(smooth.displacement_m[-1]) < 0.002
    force = smooth.branches(AT_M)
    assert (np.diff(force[0]) > 0).all()
    assert 0.0 < smooth.lost_share() < 0.1


def test_half_the_speed_gives_the_same_force() -> None:
    config = load_config("riddle2023-rods", RODS | {"body.joints.dry_friction_Nm": 0.02})
    fast, slow = (load_frame(config, displacement_m=0.1, haste=haste).branches(AT_M[:4]) for haste in (8.0, 4.0))
    assert np.abs(fast - slow).max() < 0.02 * slow.max()


def test_the_work_lost_is_friction_times_the_way_of_the_diagonals(
    smooth: Loop, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Energy of a closed loop: what the cable does not get back is rubbed off, beside the little that bending damps."""
    lengths: list[np.ndarray] = []
    force_N = np.zeros(0)
    locate = frame._locate

    def watched(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        nonlocal force_N
        locate(model, data)
        force_N = model.tendon_frictionloss.copy()
        lengths.append(data.ten_length.copy())

    monkeypatch.setattr(frame, "_locate", watched)
    config = load_config("riddle2023-rods", RODS | {"body.joints.dry_friction_Nm": 0.02})
    done, back = load_frame(config, displacement_m=0.2).work_J()
    rubbed = float((force_N * np.abs(np.diff(lengths, axis=0)).sum(axis=0)).sum())
    damped = np.subtract(*smooth.work_J())
    assert done - back == pytest.approx(rubbed + damped, rel=0.1)


def test_a_ring_cannot_be_wound_away() -> None:
    with pytest.raises(ConfigError, match="four fifths"):
        load_frame(load_config("riddle2023-rods", RODS), displacement_m=0.9)
    with pytest.raises(ConfigError, match="haste = "):
        load_frame(load_config("riddle2023-rods", RODS), haste=0.5)
    with pytest.raises(ConfigError, match="needs the 3D worm"):
        load_frame(load_config("riddle2022-planar"))


HEXAGON = 0.16 * np.array([[0, np.cos(a), np.sin(a)] for a in np.pi / 3 * np.arange(6)])


def test_a_flattened_ring_or_a_falling_tension_is_a_snap_through() -> None:
    assert frame.gave_way(HEXAGON, np.array([0.0, 2.0, 5.0, 4.9])) is None
    flat = HEXAGON * [1.0, 1.0, 0.4]
    assert "from its centre" in (frame.gave_way(flat, np.array([0.0, 2.0])) or "")
    assert "fell from 5.0 to 2.0 N" in (frame.gave_way(HEXAGON, np.array([0.0, 5.0, 2.0])) or "")


def test_a_ring_that_gives_way_stops_the_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frame, "LARGEST_FALL_N", -20.0)
    with pytest.raises(SimulationStopped, match="the ring buckled at"):
        load_frame(load_config("riddle2023-rods", RODS), displacement_m=0.1)
