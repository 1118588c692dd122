"""What is read of many worms at once is, to the last bit, what is read of each alone."""

from __future__ import annotations

from functools import cache
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.body import build_spec, compile_spec
from annelid.config import load_config
from annelid.simulation.anatomy import Anatomy
from annelid.simulation.worm import WormPlant, compile_worm

BODIES: dict[str, dict[str, Any]] = {
    "rods": {},
    "rods with separate pins": {"body.formulation.pins": "separate"},
    "chain": {"body.formulation.kind": "chain"},
}
SMALL = {"body.mesh.elements_per_side": 2, "body.mesh.n_helices": 8}


@cache
def anatomy(body: str) -> Anatomy:
    return compile_worm(load_config("riddle2023-rods", SMALL | BODIES[body]))


@pytest.mark.parametrize("body", BODIES)
@settings(max_examples=20)
@given(n_worms=st.integers(1, 9), seed=st.integers(0, 1000))
def test_many_worms_read_like_each_alone(body: str, n_worms: int, seed: int) -> None:
    part, random = anatomy(body), np.random.default_rng(seed)
    model = part.model
    shapes = {
        "actuator_force": (model.nu,),
        "sensordata": (model.nsensordata,),
        "flexedge_length": (model.nflexedge,),
        "qpos": (model.nq,),
        "xpos": (model.nbody, 3),
        "xmat": (model.nbody, 9),
    }
    engine = {name: random.normal(size=(n_worms, *shapes[name])) for name in part.outputs}
    crossing, center = random.normal(size=(n_worms, part.geometry.n_crossings, 3)), random.normal(size=(n_worms, 3))
    skin = random.normal(size=(n_worms, len(part.skin.segment), 3))
    objects = np.empty((n_worms, 0, 3))
    posture, (forces, ground) = part.posture(crossing, center, skin, objects), part.forces(engine)
    for i in range(n_worms):
        alone, ground_alone = part.forces({name: values[i] for name, values in engine.items()})
        assert np.array_equal(ground[i], ground_alone)
        for of_many, of_one in ((posture, part.posture(crossing[i], center[i], skin[i], objects[i])), (forces, alone)):
            for field in of_one._fields:
                if field == "met":
                    continue
                assert np.array_equal(getattr(of_many, field)[i], getattr(of_one, field)), field


def test_lengths_are_the_distances_along_springs_and_rings() -> None:
    part, crossing = anatomy("rods"), np.random.default_rng(1).normal(size=(anatomy("rods").geometry.n_crossings, 3))
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
