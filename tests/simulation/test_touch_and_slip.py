"""Touch, slip and its loss, against Coulomb's law and the balance of energy on a slope."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.arena.surface import Plane
from annelid.config import load_config
from annelid.protocols import SIDES, Array
from annelid.simulation.skin import Skin, Touch, sides_of
from annelid.simulation.worm import WormPlant

FORMULATIONS: dict[str, dict[str, Any]] = {
    "rods": {"body.mesh.elements_per_side": 2},
    "chain": {
        "body.formulation.kind": "chain",
        "body.mesh.elements_per_side": 2,
        "clock.physics_timestep_s": 0.002,
    },
}
SOFT = {"arena.contact_time_constant_s": 0.06}
SMOOTH: dict[str, dict[str, Any]] = {
    "rods": SOFT | {"body.formulation.friction_impedance_ratio": 1.0, "body.strands.damping_time_s": 2.0},
    "chain": SOFT,
}
"""A worm that slides fast hops and shakes; on soft ground it hardly does."""
STEP_S = 0.002
SLOPE_RAD = np.deg2rad(30.0)
BELLY, LEFT, BACK, RIGHT = range(4)


def resting(formulation: str, seconds: float = 0.6, **changes: Any) -> WormPlant:
    """A worm that has come to rest on level ground."""
    clock = {"control_timestep_s": STEP_S, "physics_timestep_s": STEP_S}
    common = {"arena.friction": 0.3, "body.strands.damping_time_s": 0.16}
    plant = WormPlant(
        load_config(
            {"clock": clock, "record": {"signals_interval_s": STEP_S}},
            {**common, **FORMULATIONS[formulation], **changes},
        )
    )
    plant.reset(0)
    return after(plant, seconds)


def after(plant: WormPlant, seconds: float) -> WormPlant:
    for _ in range(round(seconds / STEP_S)):
        plant.step(np.zeros(plant.n_muscles))
    return plant


def numbers(plant: WormPlant) -> dict[str, Array]:
    return {name: np.array(value, dtype=float) for name, value in plant.read(False).items()}


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_the_belly_of_a_resting_worm_carries_its_weight(formulation: str) -> None:
    plant = resting(formulation)
    felt = plant.step(np.zeros(plant.n_muscles))
    weight = 9.81 * plant.total_mass_kg
    assert felt.touch_N.shape == (plant.n_segments, len(SIDES))
    assert felt.touch_N.sum() == pytest.approx(weight, rel=0.02)
    assert felt.touch_N[:, BELLY].sum() == pytest.approx(weight, rel=0.02)
    assert felt.touch_N.sum(axis=1) == pytest.approx(felt.contact_force_N[:, 2], abs=1e-9), "level ground faces up"


def test_what_a_slope_takes_from_a_sliding_worm_is_its_slip_loss() -> None:
    """Joints and landings take the rest."""
    formulation, elsewhere = "rods", 0.02
    plant = resting(formulation, **SMOOTH[formulation])
    plant.model.opt.gravity[:] = -9.81 * np.sin(SLOPE_RAD), 0.0, -9.81 * np.cos(SLOPE_RAD)
    start = numbers(after(plant, 0.3))
    end = numbers(after(plant, 0.3))
    change = {name: end[name] - start[name] for name in start}
    moved = change["center_of_mass"]
    released = plant.total_mass_kg * float(plant.model.opt.gravity @ moved) - float(change["kinetic_energy"])
    assert moved[0] < -0.1, "it slides"
    assert change["slip_loss"].sum() == pytest.approx(released, rel=elsewhere)
    # A sliding worm hops: it slides no farther than it travels.
    assert np.all(change["slip_distance"] < -1.05 * moved[0])
    assert np.all(change["slip_distance"] > -0.5 * moved[0])


def test_slip_speed_is_positive_towards_the_front_and_zero_sideways() -> None:
    plant = resting("rods", **SMOOTH["rods"])
    at_rest = plant.get_state()
    for direction, forwards in (([-1.0, 0.0], 1.0), ([1.0, 0.0], -1.0), ([0.0, 1.0], 0.0)):
        plant.set_state(at_rest)
        plant.model.opt.gravity[:2] = 9.81 * np.tan(SLOPE_RAD) * np.array(direction)
        start = numbers(after(plant, 0.3))
        end = numbers(after(plant, STEP_S))
        speed = float(np.linalg.norm(end["center_of_mass"] - start["center_of_mass"])) / STEP_S
        assert speed > 0.5
        load = end["touch"].sum(axis=1)
        assert load @ end["slip_speed"] / load.sum() == pytest.approx(forwards * speed, abs=0.2 * speed)
        slid = end["slip_distance"] - start["slip_distance"]
        share = load @ slid / load.sum() / (speed * STEP_S)
        if forwards:
            assert share == pytest.approx(1.0, abs=0.2)
        else:
            assert 0.1 < share < 0.8, "a tube rolls down sideways, and slides a little"


def test_the_count_is_that_of_the_engine_s_contacts() -> None:
    plant = resting("rods")
    mujoco.mj_forward(plant.model, plant.data)
    bearing = sum(
        plant.data.efc_force[contact.efc_address] > 0.0 for contact in plant.data.contact if contact.efc_address >= 0
    )
    assert numbers(after(plant, STEP_S))["contact_count"].sum() == pytest.approx(bearing, abs=1)
    assert bearing > 5


@given(turn=st.floats(0.0, 360.0), reach=st.floats(0.01, 1.0))
def test_sides_are_quarters_and_mirror_images(turn: float, reach: float) -> None:
    right, up = reach * np.sin(np.deg2rad(turn)), -reach * np.cos(np.deg2rad(turn))
    side, mirrored = sides_of(np.array([right, -right]), np.array([up, up]))
    assert mirrored == {BELLY: BELLY, LEFT: RIGHT, BACK: BACK, RIGHT: LEFT}[int(side)]
    expected = {BELLY: -up, LEFT: -right, BACK: up, RIGHT: right}
    assert expected[int(side)] == pytest.approx(max(expected.values()), abs=1e-6)


@settings(max_examples=50)
@given(seed=st.integers(0, 10_000))
def test_on_any_plane_only_the_way_along_it_costs(seed: int) -> None:
    """Pressing in and out is no slip; a way along the plane loses friction times way, shared among the segments."""
    random = np.random.default_rng(seed)
    normal, along, _ = np.linalg.qr(random.normal(size=(3, 3)))[0].T
    n_geoms, n_segments, pull, way = 40, 3, 0.4, 0.01
    rest, segment = random.normal(size=(n_geoms, 3)), random.integers(0, n_segments, n_geoms)
    skin = Skin(rest, segment, n_segments, 0.1, Plane(normal, 0.0))
    pressure = random.uniform(0.0, 2.0, n_geoms) * (random.random(n_geoms) < 0.5)
    ground = pressure[:, None] * (normal - pull * along)
    axis = np.tile(along, (n_segments, 1))

    pressed = skin.touch(Touch.none(n_segments), ground, rest, rest + 0.02 * normal, axis, 0.1)
    load = np.array([pressure[segment == i].sum() for i in range(n_segments)])
    assert pressed.normal.sum(axis=1) == pytest.approx(load)
    assert pressed.slip_loss == pytest.approx(np.zeros(n_segments), abs=1e-12)
    assert pressed.slip_distance == pytest.approx(np.zeros(n_segments), abs=1e-12)

    slid = skin.touch(pressed, ground, rest, rest + 0.02 * normal + way * along, axis, 0.1)
    assert slid.slip_loss == pytest.approx(pull * load * way)
    assert slid.slip_distance == pytest.approx(np.where(load > 0, way, 0.0))
    assert slid.slip_speed == pytest.approx(np.where(load > 0, way / 0.1, 0.0))
    assert slid.count.sum() == np.count_nonzero(pressure)
    for i in range(n_segments):
        for side in range(len(SIDES)):
            mine = (segment == i) & (skin.side == side)
            assert slid.normal[i, side] == pytest.approx(pressure[mine].sum())
