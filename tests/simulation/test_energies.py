"""The energy totals: closed forms, the engine's own matrices, and a remainder that goes to zero with the step."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest

from annelid.body.actuators.muscle import Rings
from annelid.config import load_config
from annelid.simulation.energies import EnergyMeter
from annelid.simulation.worm import WormPlant

FREE = {"arena.floor_gap_m": 30.0, "body.rings.passive_peak": 1e-12}
"""Far above the floor, and with muscles that do not pull on their own."""
SERVOS = {"body.rings": {"kind": "servo", "layout": "halves", "force_limit_N": 6.0}}
COILS = {"body.rings": {"kind": "coil", "length_range_m": [0.95, 1.2], "coils": 20.0, "current_A": 20.0}}


def worm(step_s: float, **changes: Any) -> WormPlant:
    clock = {"control_timestep_s": step_s, "physics_timestep_s": step_s}
    record = {"signals_interval_s": step_s, "frames_interval_s": 0.04}
    plant = WormPlant(load_config({"clock": clock, "record": record}, changes))
    plant.reset(0)
    return plant


def held(plant: WormPlant) -> float:
    """Kinetic, elastic and potential energy, J."""
    return plant.kinetic_energy_J() + plant.elastic_energy_J() + plant.potential_energy_J()


def remainder(plant: WormPlant, start_J: float) -> float:
    """What the energy totals do not explain, J."""
    read = plant.read(False)
    losses = float(read["damping_loss"]) + float(read["constraint_loss"])
    return float(np.sum(read["muscle_work"])) - losses - (held(plant) - start_J)


def test_a_falling_worm_turns_potential_into_kinetic_energy() -> None:
    """By BDF2 from rest it falls half a step late. The hinges' holders, a millionth of the mass, do not fall."""
    step_s, n_steps, gravity = 0.002, 50, 9.81
    plant = worm(step_s, **FREE)
    start = plant.potential_energy_J()
    for _ in range(n_steps):
        plant.step(np.zeros(3))
    mass, falls_s = plant.total_mass_kg, (n_steps - 0.5) * step_s
    assert plant.kinetic_energy_J() == pytest.approx(0.5 * mass * (gravity * falls_s) ** 2, rel=1e-5)
    assert start - plant.potential_energy_J() == pytest.approx(0.5 * mass * (gravity * falls_s) ** 2, rel=2e-3)
    assert plant.elastic_energy_J() == pytest.approx(0.0, abs=1e-9)
    assert remainder(plant, start) == pytest.approx(0.0, abs=2e-3 * plant.kinetic_energy_J())
    read = plant.read(False)
    assert np.abs(read["muscle_work"]).max() + abs(float(read["damping_loss"])) < 1e-9


def test_the_work_of_a_push_is_accounted_for() -> None:
    """Weightless, every crossing in proportion to its mass: it goes as one, by a constant force."""
    plant = worm(0.002, **FREE, **{"arena.gravity_m_per_s2": 0.0})
    mass = plant.model.body_mass[plant.anatomy.crossing_body]
    plant.push(5.0 * (mass / mass.sum())[:, np.newaxis] * [0.0, 1.0, 0.0])
    for _ in range(100):
        plant.step(np.zeros(3))
    given_J = (5.0 * 0.2) ** 2 / 2 / plant.total_mass_kg
    assert -float(plant.read(False)["constraint_loss"]) == pytest.approx(given_J, rel=0.02)
    assert remainder(plant, 0.0) == pytest.approx(0.0, abs=0.02 * given_J)


@pytest.mark.parametrize("damping", [pytest.param(0.0, marks=pytest.mark.slow), 0.016])
def test_a_ringing_net_keeps_its_energy_but_for_dampers_and_edges(damping: float) -> None:
    """Weightless, set moving lengthwise: what is missing shrinks with the step."""
    missing, swapped, lost = [], [], []
    for step_s in (0.002, 0.001, 0.0005):
        quiet = {**FREE, "arena.gravity_m_per_s2": 0.0, "body.strands.damping_time_s": damping}
        plant = worm(step_s, **quiet)
        start = 0.0
        for crossing, place in enumerate(plant.geometry.crossings_m):
            speed = 0.5 * float(place[0] - plant.geometry.length_m / 2)
            name = f"crossing_{crossing}"
            plant.data.qvel[plant.model.joint(f"{name}_x").dofadr[0]] = speed
            start += 0.5 * float(plant.model.body(name).mass[0]) * speed**2
            plant.mechanics.rest()
        elastic = []
        for _ in range(round(0.1 / step_s)):
            plant.step(np.zeros(3))
            elastic.append(plant.elastic_energy_J())
        missing.append(remainder(plant, start) / start)
        swapped.append(max(elastic) / start)
        lost.append(float(plant.read(False)["damping_loss"]) / start)
    assert swapped[-1] > 0.2, "energy must go to and fro"
    assert lost[-1] > 0.005 if damping else lost[-1] == 0.0
    assert abs(missing[2]) < abs(missing[1]) < abs(missing[0])


def test_what_ties_store_and_take_is_accounted_for() -> None:
    """Pins that part: springs and dashpots, which are rows for the engine; the remainder shrinks with the step."""
    missing, held_J = [], []
    for step_s in (0.004, 0.002, 0.001):
        ties = {"body.formulation.pins": "separate", "body.strands.damping_time_s": 0.7}
        plant = worm(step_s, **ties)
        start = held(plant)
        for _ in range(round(0.2 / step_s)):
            plant.step(np.array([0.0, 1.0, 0.0]))
        work = float(np.sum(plant.read(False)["muscle_work"]))
        missing.append(remainder(plant, start) / work)
        held_J.append(plant.elastic_energy_J() / work)
    assert abs(missing[2]) < 0.7 * abs(missing[1]) < 0.5 * abs(missing[0])
    assert abs(missing[2]) < 0.03
    assert held_J[2] > 0.1


@pytest.mark.parametrize("rings", [{}, SERVOS, COILS], ids=["muscles", "servos", "coils"])
def test_slopes_of_the_actuators_are_those_that_the_engine_s_integrator_takes(rings: dict[str, Any]) -> None:
    plant = worm(0.005, **rings)
    data, n = plant.data, plant.n_muscles
    energy_meter = plant.anatomy.energy_meter
    assert energy_meter.slopes is not None
    activation = np.resize([1.0, 0.0, 0.3], n)
    met = set()
    for _ in range(80):
        plant.step(activation)
        ids, h = data.efm_aid[: data.nefmA], plant.model.opt.timestep
        stiffness, metric = np.zeros(n), np.zeros(n)
        stiffness[ids] = data.efm_ak[: data.nefmA]
        metric[ids] = data.efm_as[: data.nefmA]
        drive = plant.anatomy.rings.drive(activation, data.act)
        per_length, per_rate = energy_meter.slopes(
            data.actuator_length, data.actuator_velocity, drive, -data.actuator_force
        )
        assert h * per_length == pytest.approx(stiffness, abs=1e-9)
        assert h * per_rate + h * h * per_length == pytest.approx(metric, abs=1e-9)
        met |= set((per_length > 0).tolist())
    assert met == {True, False}


SPRING_MASS = """
<mujoco>
  <option integrator="discrete" solver="Newton" timestep="{step_s}" gravity="0 0 0"/>
  <worldbody>
    <site name="wall"/>
    <body pos="1 0 0"><joint type="slide" axis="1 0 0"/><geom size="0.1" mass="2"/><site name="mass"/></body>
  </worldbody>
  <tendon>
    <spatial name="cable" stiffness="80" damping="1.5" springlength="0.9">
      <site site="wall"/><site site="mass"/>
    </spatial>
  </tendon>
  <actuator><general name="ring_0" tendon="cable" {actuator}/></actuator>
</mujoco>
"""
RINGS = Rings()
LAW = "0.75 1.05 117.57 200 0.58 1.6 1.5 1.3 1.2"
MUSCLE = f'gaintype="muscle" biastype="muscle" lengthrange="0.5 1.1" gainprm="{LAW}" biasprm="{LAW}"'


def pulled(data: mujoco.MjData, before_m_per_s: float) -> float:
    """What drew the mass of `SPRING_MASS` in during a step, N, by Newton's second law: all but spring and damper."""
    speed, spring_m = float(data.qvel[0]), float(data.qpos[0]) + 0.1
    return -2.0 * (speed - before_m_per_s) / data.model.opt.timestep - 80.0 * spring_m - 1.5 * speed


@pytest.mark.parametrize("step_s", [0.02, 0.0005])
def test_the_tension_of_a_muscle_that_sets_in_at_once_is_what_draws_its_load(step_s: float) -> None:
    model = mujoco.MjModel.from_xml_string(SPRING_MASS.format(step_s=step_s, actuator=MUSCLE))
    data, energy_meter = mujoco.MjData(model), EnergyMeter(model, RINGS)
    data.ctrl[:] = 1.0
    for step in range(round(0.2 / step_s)):
        before = float(data.qvel[0])
        mujoco.mj_step(model, data)
        tension = energy_meter.read(data, data.ctrl).tension
        assert tension[0] == pytest.approx(pulled(data, before), rel=1e-6)
        if step == 0:
            assert 0.0 < tension[0] < -data.actuator_force[0], "the load yields within the step"
    assert data.qpos[0] < -0.1


def test_positive_work_is_that_of_the_steps_in_which_a_muscle_shortens() -> None:
    plant = worm(0.005)
    expected, last = np.zeros(3), plant.energies.muscle_work
    for step in range(80):
        plant.step(np.array([1.0, 0.0, 0.3]) if step < 40 else np.array([0.3, 1.0, 0.0]))
        expected += np.maximum(plant.energies.muscle_work - last, 0.0)
        last = plant.energies.muscle_work
    assert plant.energies.positive_work == pytest.approx(expected, abs=1e-12)
    assert (plant.energies.positive_work - last).max() > 1e-3, "a muscle must have been lengthened while it pulled"
