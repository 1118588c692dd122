"""What is read of a compiled worm, and that strides are its steps."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from annelid.body import build_spec, compile_spec
from annelid.config import load_config
from annelid.simulation.worm import WormPlant, compile_worm

SMALL = {"body.mesh.elements_per_side": 2, "body.mesh.n_helices": 8}


def test_lengths_are_the_distances_along_springs_and_rings() -> None:
    part = compile_worm(load_config("riddle2023-rods", SMALL))
    crossing = np.random.default_rng(1).normal(size=(part.geometry.n_crossings, 3))
    posture = part.posture(crossing, np.zeros(3), np.zeros((0, 3)), np.zeros((0, 3)))
    first, second = crossing[part.geometry.springs].transpose(1, 0, 2)
    assert posture.spring_length == pytest.approx(np.linalg.norm(second - first, axis=1))
    assert posture.stretch == pytest.approx(posture.spring_length[part.geometry.sensor_springs])
    for ring, length in zip(part.geometry.rings, posture.ring_length, strict=True):
        corners = crossing[[*ring, ring[0]]]
        assert length == pytest.approx(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum())


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
