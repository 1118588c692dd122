"""Steps of second order: stable with much damping, servos wind as by the engine's step, restored to the bit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from annelid.config import load_config
from annelid.errors import ConfigError
from annelid.simulation.adjust import adjusted
from annelid.simulation.batch_body import BodyBatch, compile_worms
from annelid.simulation.energies import plastic_at_rest
from annelid.simulation.stepping import build_controller, start
from annelid.simulation.worm import WormPlant


def plant(preset: str, integrator: str, **changes: Any) -> WormPlant:
    made = WormPlant(load_config(preset, {"body.formulation.integrator": integrator, **changes}))
    made.reset(0)
    return made


@pytest.mark.parametrize("step_s", [0.005, 0.02, 0.06])
def test_a_much_damped_worm_loses_what_its_muscles_put_in(step_s: float) -> None:
    """Before twist followed the vertices, energy came from nowhere within 0.4 s."""
    changes = {"body.strands.damping_time_s": 1.45, "clock.physics_timestep_s": step_s}
    worm = plant("riddle2023-rods", "BDF2", **changes)
    worm.move(np.array([1.0, 0.0, 0.0]), round(0.6 / step_s))
    held, work = worm.elastic_energy_J() + worm.kinetic_energy_J(), float(worm.energies.muscle_work.sum())
    assert 0.0 < held < work
    assert worm.kinetic_energy_J() < 0.05 * work


@pytest.mark.parametrize("modulus_Pa", [0.3e9, (0.3e9, 0.6e9, 0.2e9)])
def test_what_vertices_do_to_twist_is_the_mixed_derivative_of_the_energy(modulus_Pa: Any) -> None:
    worm = plant("riddle2023-rods", "BDF2", **{"body.strands.young_modulus_Pa": modulus_Pa})
    assert worm.two_step is not None
    assert worm.damping is not None
    twist, random = worm.two_step._twist, np.random.default_rng(2)
    shift, turn = np.zeros(worm.model.nv), np.zeros(worm.model.nv)
    shift[twist._dof.ravel()] = 1e-4 * random.normal(size=twist._dof.size)
    turn[twist._hinge] = 1e-3 * random.normal(size=twist._hinge.size)
    rest, plastic = worm.qpos.copy(), plastic_at_rest(worm.model)
    energies = {
        (along, about): worm.anatomy.elasticity.energy_J(
            rest + along * shift + about * turn, plastic, worm.posture.spring_length
        )
        for along in (-1, 1)
        for about in (-1, 1)
    }
    mixed_J = (energies[1, 1] - energies[1, -1] - energies[-1, 1] + energies[-1, -1]) / 4.0
    worm.damping.renew(rest)
    qpos, qvel = rest.copy(), shift.copy()
    # At a steady velocity the viscous part is the engine's.
    twist.follow(qpos, qvel, shift, worm.damping.bent)
    change = (qvel - shift)[twist._hinge].reshape(worm.model.nflex, -1)
    torque = np.linalg.solve(twist._inverse, change[..., None]).ravel()
    assert abs(mixed_J) > 1e-9
    assert torque @ turn[twist._hinge] == pytest.approx(-worm.model.opt.timestep * mixed_J, rel=1e-3)


def test_what_is_lost_to_the_step_shrinks_with_it() -> None:
    shares = []
    for step_s in (0.02, 0.005):
        worm = plant("riddle2023-rods", "BDF2", **{"clock.physics_timestep_s": step_s})
        start = worm.potential_energy_J()
        for level in (1.0, 0.0):
            worm.move(np.array([level, 0.0, 0.0]), round(0.5 / step_s))
        work = float(worm.energies.muscle_work.sum())
        held = worm.elastic_energy_J() + worm.kinetic_energy_J() + worm.potential_energy_J() - start
        shares.append((work - held - float(worm.energies.damping_loss + worm.energies.constraint_loss)) / work)
    assert abs(shares[1]) < 0.5 * abs(shares[0])
    assert abs(shares[0]) < 0.1


def test_in_a_scene_whose_bodies_move_the_step_is_the_engine_s(tmp_path: Path) -> None:
    """From an extrapolated state a box on the floor would rattle and a pendulum swing ever farther."""
    (tmp_path / "scene.xml").write_text(
        '<mujoco><worldbody><geom type="plane" size="5 5 1"/><body pos="-1 0 0.041"><freejoint/>'
        '<geom type="box" size="0.04 0.04 0.04" mass="0.5"/></body><body pos="-2 0 1.5"><joint type="hinge" '
        'axis="0 1 0"/><geom type="sphere" size="0.02" pos="0.3 0 -0.95" mass="0.1"/></body></worldbody></mujoco>'
    )
    config = load_config("riddle2023-rods", {"body.mesh.elements_per_side": 1}, arena=tmp_path / "scene.xml")
    worm = WormPlant(config)
    worm.reset(0)
    assert worm.two_step is None
    highest = 0.0
    for _ in range(150):
        worm.move(np.zeros(3), 1)
        highest = max(highest, abs(float(worm.qpos[-1])))
    assert highest < 0.7
    assert np.abs(worm.engine["qvel"][-7:-1]).max() < 1e-3


@pytest.mark.parametrize("activation_dynamics", [False, True])
def test_a_batch_computes_the_same_bits(activation_dynamics: bool) -> None:
    for preset, changes in (
        ("riddle2023-rods", {"body.rings.activation_dynamics": activation_dynamics}),
        ("riddle2025", {"body.formulation.integrator": "BDF2"}),
    ):
        config = load_config(preset, {**changes, "body.mesh.elements_per_side": 1})
        alone, bodies = WormPlant(config), BodyBatch([config, config], compile_worms([config, config]))
        for worm in (alone, *bodies.worms):
            worm.reset(0)
        pull = np.linspace(0.2, 1.0, alone.n_muscles)
        alone.move(pull, 4)
        bodies.move([0, 1], np.stack([pull, pull]), 4)
        assert np.array_equal(alone.qpos, bodies.worms[1].qpos)
        assert np.array_equal(alone.act, bodies.worms[1].act)
        for worm in (alone, bodies.worms[0]):
            worm.set_state(bodies.worms[1].get_state())
        bodies.move([0], pull[np.newaxis], 2)
        alone.move(pull, 2)
        assert np.array_equal(alone.qpos, bodies.worms[0].qpos)


def test_a_clock_that_changes_while_it_runs_starts_from_rest() -> None:
    """What a worm was one step ago is of the old step."""
    config = load_config("riddle2023-rods", {"body.mesh.elements_per_side": 1, "clock.physics_timestep_s": 0.04})
    finer = load_config("riddle2023-rods", {"body.mesh.elements_per_side": 1, "clock.physics_timestep_s": 0.005})
    worm = WormPlant(config)
    running = start(config, worm, build_controller(config, worm), None)
    while running.sensation.time_s < 0.5:
        running.advance()
    going = adjusted(running, config, finer)
    assert isinstance(going.plant, WormPlant)
    assert going.plant.two_step is not None
    assert np.array_equal(going.plant.two_step.get_state()["qpos_before"], going.plant.qpos)


def test_servos_wind_as_by_the_engine_s_step() -> None:
    slack = []
    for integrator in ("BDF2", "Euler"):
        worm = plant("riddle2025", integrator, **{"body.mesh.elements_per_side": 1})
        pull = np.ones(worm.n_muscles)
        worm.move(pull, 3)
        slack.append(worm.act.copy())
        # Paid out again, they stop at their longest.
        worm.move(np.zeros(worm.n_muscles), 5)
        slack.append(worm.act.copy())
    assert slack[0] == pytest.approx(slack[2], abs=1e-12)
    assert slack[1] == pytest.approx(worm.model.actuator_actrange[:, 1], abs=1e-12)
    assert slack[0].max() < slack[1].min()


def test_a_worm_goes_on_from_its_state_to_the_bit() -> None:
    changes = {"body.mesh.elements_per_side": 1}
    first, second = (plant("riddle2023-rods", "BDF2", **changes) for _ in range(2))
    pull = np.array([1.0, 0.0, 0.4])
    first.move(pull, 4)
    second.set_state(first.get_state())
    for worm in (first, second):
        worm.move(pull, 3)
    assert np.array_equal(first.qpos, second.qpos)
    assert np.array_equal(first.engine["qvel"], second.engine["qvel"])
    assert first.data.time == pytest.approx(7 * 0.02)


def test_material_without_damping_is_refused() -> None:
    with pytest.raises(
        ConfigError, match=r"body\.formulation\.integrator = 'BDF2': must be 'Euler' where .* no damping"
    ):
        load_config("riddle2023-rods", {"body.strands.damping_time_s": None})
