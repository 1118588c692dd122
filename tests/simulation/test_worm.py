"""The 3D worm as a plant: what it feels is what the engine holds, and it continues bit for bit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from annelid.body import build_spec, compile_spec
from annelid.config import RunConfig, load_config
from annelid.simulation.worm import WormPlant, compile_worm

CHAIN = {
    "body.formulation.kind": "chain",
}
FORMULATIONS = {
    "rods": {},
    "soft chain": CHAIN,
    "stiff chain": {
        **CHAIN,
        "body.formulation.pin_time_constant_s": 0.01,
        "body.formulation.pin_impedance": [0.999, 0.9999, 0.001],
    },
}


def config(formulation: str = "rods", /, **changes: Any) -> RunConfig:
    return load_config(
        {"clock": {"control_timestep_s": 0.001, "physics_timestep_s": 0.005}},
        {**FORMULATIONS[formulation], **changes},
    )


def advance(plant: WormPlant, activation: np.ndarray, seconds: float) -> None:
    for _ in range(round(seconds / 0.001)):
        plant.step(activation)


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_lengths_are_the_engine_s_at_the_end_of_the_step(formulation: str) -> None:
    plant = WormPlant(config(formulation))
    plant.reset(0)
    advance(plant, np.array([0.0, 1.0, 0.0]), 0.05)
    felt = plant.observe()
    mujoco.mj_forward(plant.model, plant.data)
    rings = [plant.model.tendon(f"ring_{s}").id for s in range(3)]
    springs = [plant.model.tendon(f"spring_{k}").id for k in plant.geometry.sensor_springs.ravel()]
    assert felt.ring_length_m == pytest.approx(plant.data.ten_length[rings], abs=1e-12)
    assert felt.stretch_m.ravel() == pytest.approx(plant.data.ten_length[springs], abs=1e-12)
    assert felt.center_of_mass_m == pytest.approx(plant.data.subtree_com[0], abs=1e-9)


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_restored_worm_continues_bit_for_bit(formulation: str) -> None:
    pull = np.array([1.0, 0.2, 0.0])
    straight = WormPlant(config(formulation))
    straight.reset(0)
    advance(straight, pull, 0.052)
    state = straight.get_state()
    advance(straight, pull, 0.052)

    restored = WormPlant(config(formulation))
    restored.reset(0)
    restored.set_state(state)
    advance(restored, pull, 0.052)
    for frame in (False, True):
        expected, actual = straight.read(frame), restored.read(frame)
        for name, value in expected.items():
            assert np.array_equal(value, actual[name]), name


def test_physics_steps_fall_due_with_the_slower_clock() -> None:
    plant = WormPlant(config())
    start = plant.reset(0)
    pull = np.ones(3)
    held = [plant.step(pull) for _ in range(4)]
    moved = plant.step(pull)
    assert all(np.array_equal(feel.ring_length_m, start.ring_length_m) for feel in held)
    assert not np.array_equal(moved.ring_length_m, start.ring_length_m)
    assert plant.data.time == pytest.approx(0.005)
    assert moved.time_s == pytest.approx(0.005)

    fine = WormPlant(config(**{"clock.physics_timestep_s": 0.0005}))
    fine.reset(0)
    fine.step(pull)
    assert fine.data.time == pytest.approx(0.001)


@pytest.mark.parametrize(
    ("limit", "words"),
    [
        ("guard.height_m", "height of a crossing"),
        ("guard.edge_strain", "edge strain"),
        ("guard.kinetic_energy_J", "kinetic energy"),
    ],
)
def test_the_guard_names_the_quantity_that_ran_away(limit: str, words: str) -> None:
    plant = WormPlant(config(**{limit: 1e-6}))
    plant.reset(0)
    alarms = []
    for _ in range(100):
        plant.step(np.ones(3))
        alarms.append(plant.alarm())
    assert any(alarm and words in alarm and limit in alarm for alarm in alarms)


def test_the_soft_pins_part_and_the_guard_watches_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("annelid.simulation.worm.MOST_GAP_M", 0.002)
    plant = WormPlant(config("soft chain"))
    plant.reset(0)
    advance(plant, np.ones(3), 0.2)
    alarm = plant.alarm()
    assert alarm is not None
    assert "gap between the pinned strands" in alarm


def test_the_engine_s_warnings_become_alarms_and_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    stiff = {"clock.physics_timestep_s": 0.1, "body.strands.young_modulus_Pa": 1e12}
    plant = WormPlant(config(**stiff))
    plant.model.opt.iterations = 10
    plant.reset(0)
    alarms = [(plant.step(np.array([1.0, 0.0, 0.0])), plant.alarm())[1] for _ in range(300)]
    assert any(alarm and "did not converge" in alarm for alarm in alarms)
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_contact_sensors_change_nothing_in_the_motion() -> None:
    # A chain's plant takes the engine's own steps, so that the model can be stepped without one.
    changes = {"body.mesh.n_helices": 8, "clock.physics_timestep_s": 0.001}
    config = load_config("riddle2023", changes)
    plant = WormPlant(config)
    plant.reset(0)
    spec = build_spec(config)
    spec.option.disableflags = plant.model.opt.disableflags
    plain = compile_spec(spec)
    data = mujoco.MjData(plain)
    pull = np.array([1.0, 0.0, 0.5])
    for _ in range(10):
        plant.step(pull)
    data.ctrl[:] = pull
    mujoco.mj_step(plain, data, 10)
    assert np.array_equal(plant.data.qpos, data.qpos)
    assert plant.model.nsensor > plain.nsensor


def test_lengths_are_the_distances_along_springs_and_rings() -> None:
    part = compile_worm(config())
    crossing = np.random.default_rng(1).normal(size=(part.geometry.n_crossings, 3))
    posture = part.posture(crossing, np.zeros(3), np.zeros((0, 3)), np.zeros((0, 3)))
    first, second = crossing[part.geometry.springs].transpose(1, 0, 2)
    assert posture.spring_length == pytest.approx(np.linalg.norm(second - first, axis=1))
    assert posture.stretch == pytest.approx(posture.spring_length[part.geometry.sensor_springs])
    for ring, length in zip(part.geometry.rings, posture.ring_length, strict=True):
        corners = crossing[[*ring, ring[0]]]
        assert length == pytest.approx(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum())
