"""Planes laid ahead of what approaches: skin ends the step on the ground, at any speed, step and contact."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.simulation.ground import BARELY_M, HELD_WITHIN_M, depth_m, rows_of

RADIUS_M = 0.003


def falling(step_s: float, time_constant_s: float, integrator: str) -> mujoco.MjModel:
    """A weightless ball on a slide over a plane that moves."""
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.gravity = step_s, [0.0, 0.0, 0.0]
    spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    holder = spec.worldbody.add_body(name="ground", mocap=True)
    holder.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 1], contype=0, conaffinity=0)
    ball = spec.worldbody.add_body(name="ball")
    ball.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    ball.add_geom(name="ball", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[RADIUS_M, 0, 0], contype=0, conaffinity=0)
    spec.add_pair(
        geomname1="ground",
        geomname2="ball",
        condim=1,
        solref=[time_constant_s, 1.0],
        solimp=[0.9999, 0.9999, 0.001, 0.5, 2.0],
    )
    return spec.compile()


@pytest.mark.parametrize("integrator", ["DISCRETE", "EULER"])
@settings(max_examples=40, deadline=None)
@given(
    step_s=st.sampled_from([0.001, 0.005, 0.01]),
    time_constant_s=st.floats(0.002, 0.03),
    speed_m_per_s=st.floats(0.05, 3.0),
    gap=st.floats(-1.0, 0.99),
)
def test_a_ball_that_comes_fast_ends_the_step_on_the_ground(
    integrator: str, step_s: float, time_constant_s: float, speed_m_per_s: float, gap: float
) -> None:
    """From anywhere within reach: on the ground or stopped above it; from within the ground it goes no deeper."""
    model = falling(step_s, time_constant_s, integrator)
    data = mujoco.MjData(model)
    approach = speed_m_per_s * step_s
    gap_m = gap * approach
    data.qpos[0], data.qvel[0] = gap_m + RADIUS_M, -speed_m_per_s
    depth = depth_m(np.array([gap_m]), np.array([approach]), np.array([False]), rows_of(model))
    data.mocap_pos[0, 2] = data.qpos[0] - (RADIUS_M - depth[0])
    mujoco.mj_step(model, data)
    reached = data.qpos[0] - RADIUS_M
    assert min(gap_m, 0.0) - 1e-3 * approach <= reached <= max(gap_m, 0.0) + 1e-3 * approach + BARELY_M


def test_skin_is_felt_in_the_ground_and_near_to_it_once_it_has_touched() -> None:
    rows = rows_of(falling(0.005, 0.01, "DISCRETE"))
    gap = np.array([-0.002, 0.5 * HELD_WITHIN_M, 0.5 * HELD_WITHIN_M, 1.5 * HELD_WITHIN_M])
    at_rest = depth_m(gap, np.zeros(4), np.array([True, True, False, True]), rows)
    assert at_rest[0] == 0.002
    assert 0.0 < at_rest[1] < 1e-4
    assert at_rest[2:] == pytest.approx(-gap[2:])
