"""The planar worms with masses and forces: energy, momentum, friction, equilibrium, simulation, and their face."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from annelid.config import Clock
from annelid.protocols import Sensation
from annelid_studies.planar import Boxerbaum2012Plant, Daltorio2013Plant
from annelid_studies.planar.boxerbaum2012 import Boxerbaum2012Body
from annelid_studies.planar.daltorio2013 import Daltorio2013Body
from annelid_studies.planar.dynamic import DynamicPlanarPlant

CLOCK = Clock(control_timestep_s=0.005, physics_timestep_s=0.001)
UNTOUCHED: dict[str, Any] = {"pipe_diameter_m": 0.3}
WITHOUT_LOSSES: dict[str, Any] = {"height_damping_Ns_per_m": 0.0, "torsion_damping_Nms_per_rad": 0.0}


def daltorio(clock: Clock = CLOCK, **body) -> Daltorio2013Plant:
    return Daltorio2013Plant(Daltorio2013Body(**{"n_segments": 3, **body}), clock)


def boxerbaum(clock: Clock = CLOCK, **body) -> Boxerbaum2012Plant:
    return Boxerbaum2012Plant(Boxerbaum2012Body(**{"n_segments": 3, **body}), clock)


BOTH = pytest.mark.parametrize("build", [daltorio, boxerbaum])


def energy(plant: DynamicPlanarPlant) -> float:
    return plant.kinetic_energy_J() + plant.elastic_energy_J()


def held(plant: DynamicPlanarPlant, activation, n_steps: int) -> Sensation:
    felt = plant.step(np.asarray(activation, dtype=float))
    for _ in range(n_steps - 1):
        felt = plant.step(np.asarray(activation, dtype=float))
    return felt


def coordinates(plant: DynamicPlanarPlant) -> np.ndarray:
    return np.array(plant.get_state()["q"], dtype=float)


def squeezed(plant: DynamicPlanarPlant, factors) -> DynamicPlanarPlant:
    q = coordinates(plant)
    q[1 : 1 + plant.n_segments] *= factors
    plant.set_state({**plant.get_state(), "q": q})
    return plant


def waves(plant: DynamicPlanarPlant, contraction_s: float, n: int) -> list:
    """Contracts one segment after another, front to rear, and returns what was felt."""
    steps = round(contraction_s / 0.005)
    felt = [plant.step(np.eye(plant.n_segments)[i // steps % plant.n_segments]) for i in range(n * steps)]
    assert plant.alarm() is None
    return felt


@pytest.mark.parametrize(("build", "extra"), [(daltorio, {"wall_friction": 0.0}), (boxerbaum, {})])
def test_without_losses_energy_is_kept(build, extra) -> None:
    plant = squeezed(build(**WITHOUT_LOSSES, **extra), [0.96, 0.9, 0.98])
    start = energy(plant)
    energies = []
    for _ in range(400):
        plant.step(np.zeros(3))
        energies.append(energy(plant))
    assert np.abs(np.array(energies) / start - 1.0).max() < 1e-3
    assert plant.kinetic_energy_J() > 0.0


@BOTH
def test_the_books_close(build) -> None:
    """The start's energy, plus what the muscles did, minus all losses, is what is left; the rest is integration."""
    errors = []
    for physics_s in (0.001, 0.0005):
        plant = build(Clock(control_timestep_s=0.005, physics_timestep_s=physics_s))
        start = energy(plant)
        waves(plant, 0.3, 3)
        books = plant.read(frame=False)
        work, slip = np.sum(books["muscle_work"]), np.asarray(books.get("slip_loss", 0.0))
        lost = float(np.asarray(books["damping_loss"])) + slip.sum()
        assert work > 0.5
        assert np.all(slip >= 0.0)
        errors.append(abs(energy(plant) - start - work + lost) / work)
    assert errors[0] < 1e-3
    assert errors[1] < 0.5 * errors[0]


@pytest.mark.parametrize("friction", [0.2, 1.0])
def test_a_gliding_worm_is_stopped_by_friction_as_a_block_is(friction: float) -> None:
    plant = daltorio(Clock(control_timestep_s=0.001, physics_timestep_s=0.001), wall_friction=friction)
    mass, speed = plant.worm.lump_mass_kg.sum(), 0.4
    rest = plant.reset(0)
    momentum = plant.worm.posture(coordinates(plant)).mass[:, 0] * speed
    normal, start = rest.contact_force_N[:, 2].sum(), rest.center_of_mass_m[0]
    plant.set_state({**plant.get_state(), "p": momentum})
    felt = held(plant, np.zeros(3), round(1.3 * mass * speed / (2 * friction * normal) / 0.001))
    way = mass * speed**2 / 2 / (2 * friction * normal)
    assert felt.center_of_mass_m[0] - start == pytest.approx(way, rel=0.02)
    slip = np.asarray(plant.read(frame=False)["slip_loss"])
    assert slip.sum() == pytest.approx(mass * speed**2 / 2, rel=0.02)
    assert plant.kinetic_energy_J() < 1e-9


def test_vertices_that_stick_do_not_creep() -> None:
    plant = daltorio(wall_friction=5.0)
    places = []
    for _ in range(200):
        plant.step(np.array([1.0, 0.0, 0.0]))
        places.append(plant.worm.places(plant.worm.posture(coordinates(plant)))[plant.worm.vertices[1:], 0])
    settled = np.array(places[100:])
    assert np.abs(np.ptp(settled, axis=0)).max() < 1e-9


@pytest.mark.parametrize("activation", [0.3, 1.0])
def test_all_muscles_alike_balance_the_return_springs(activation: float) -> None:
    """Virtual work on one rhombus: ``F = k (l - l_0) h / l``, whatever couples the neighbours."""
    for build in (daltorio, boxerbaum):
        plant = build(height_damping_Ns_per_m=8.0, **(UNTOUCHED if build is daltorio else {}))
        felt = held(plant, np.full(3, activation), 200)
        height = felt.ring_length_m[0]
        length, rest = np.sqrt(0.146**2 - height**2), np.sqrt(0.146**2 - 0.11**2)
        assert felt.ring_length_m == pytest.approx(np.full(3, height), abs=1e-5)
        assert felt.muscle_force_N == pytest.approx(np.full(3, 200.0 * (length - rest) * height / length), rel=1e-3)


def test_at_rest_the_walls_carry_the_return_springs() -> None:
    felt = daltorio().reset(0)
    height, length = felt.ring_length_m[1], felt.stretch_m[1, 0]
    pull = 200.0 * (length - np.sqrt(0.146**2 - 0.11**2)) * height / length
    assert 0.1 < height < 0.11
    assert felt.contact_force_N[:, 2] == pytest.approx(np.full(3, pull), rel=1e-6)
    assert daltorio(pipe_diameter_m=0.2).reset(0).ring_length_m == pytest.approx(np.full(3, 0.11))


def neighbour_s_share(build, stiffness: float) -> float:
    """How much the neighbour of a contracted end segment is lower, relative to that segment itself."""
    plant = build(torsion_stiffness_Nm_per_rad=stiffness, **(UNTOUCHED if build is daltorio else {}))
    drop = 0.11 - held(plant, [1.0, 0.0, 0.0], 250).ring_length_m
    return float(drop[1] / drop[0])


def test_contraction_spreads_to_the_neighbours_of_bending_sides_over_a_range() -> None:
    shares = [neighbour_s_share(boxerbaum, stiffness) for stiffness in (0.1, 0.2, 0.5, 1.0)]
    assert shares[0] > 0.0
    assert np.all(np.diff(shares) > 0.0)


@BOTH
def test_restored_worm_continues_bit_for_bit(build) -> None:
    drive = np.random.default_rng(0).random((60, 3))
    one, other = build(), build()
    for activation in drive[:30]:
        one.step(activation)
    other.set_state(one.get_state())
    for activation in drive[30:]:
        one.step(activation)
        other.step(activation)
    for name, value in one.read(frame=False).items():
        assert np.array_equal(np.asarray(value), np.asarray(other.read(frame=False)[name])), name
    assert {k: v.shape for k, v in one.get_state().items()} == {k: v.shape for k, v in build().get_state().items()}


def test_a_worm_whose_muscles_overpower_it_raises_the_alarm() -> None:
    plant = boxerbaum(muscle_force_N=3000.0, height_shortest_m=0.001, height_damping_Ns_per_m=1.0)
    assert plant.alarm() is None
    for _ in range(100):
        plant.step(np.array([1.0, 0.0, 1.0]))
        if plant.alarm():
            break
    assert plant.alarm()
