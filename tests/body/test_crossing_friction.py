"""Friction of the crossings: the force that a scissor needs to move, and what reaches the engine."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from annelid.body import build_spec
from annelid.body.actuation import add_diagonal_friction
from annelid.body.worm import WormBody
from annelid.config import load_config

SIDE_M = 0.09
FRICTION_N = 0.5
STEP_S = 0.005


def scissor(half_angle_rad: float, *, dry_N: float = 0.0, viscous_Ns_per_m: float = 0.0) -> mujoco.MjModel:
    """A rhombus of four rigid sides whose corners slide on its diagonals; friction lies along x."""
    spec = mujoco.MjSpec()
    spec.option.gravity = [0, 0, 0]
    spec.option.timestep = STEP_S
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    x, y = SIDE_M * np.cos(half_angle_rad), SIDE_M * np.sin(half_angle_rad)
    for name, place, axis in (
        ("front", [-x, 0, 0], [1, 0, 0]),
        ("rear", [x, 0, 0], [1, 0, 0]),
        ("left", [0, y, 0], [0, 1, 0]),
        ("right", [0, -y, 0], [0, 1, 0]),
    ):
        body = spec.worldbody.add_body(name=name, pos=place, mass=0.002, inertia=[1e-6] * 3, explicitinertial=True)
        body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        body.add_site(name=name)
    for one in ("front", "rear"):
        for other in ("left", "right"):
            side = spec.add_tendon(name=f"{one}_{other}")
            side.wrap_site(one)
            side.wrap_site(other)
            spec.add_equality(
                name=f"{one}_{other}",
                type=mujoco.mjtEq.mjEQ_TENDON,
                objtype=mujoco.mjtObj.mjOBJ_TENDON,
                name1=f"{one}_{other}",
                data=[0.0] * 12,
                solref=[2 * STEP_S, 1.0],
                solimp=[0.99, 0.999, 0.001, 0.5, 2.0],
            )
    add_diagonal_friction(spec, "diagonal", ("front", "rear"), dry_N, viscous_Ns_per_m)
    return spec.compile()


def squeezed(model: mujoco.MjModel, force_N: float, *, after_s: float, seconds: float) -> float:
    """Mean speed at which the side corners approach under a force on both, m/s, from a given time on."""
    data = mujoco.MjData(model)
    data.qfrc_applied[model.joint("left").dofadr[0]] = -force_N
    data.qfrc_applied[model.joint("right").dofadr[0]] = force_N
    approach = []
    for duration in (after_s, seconds):
        mujoco.mj_step(model, data, round(duration / STEP_S))
        approach.append(float(data.joint("right").qpos[0] - data.joint("left").qpos[0]))
    return (approach[1] - approach[0]) / seconds


@pytest.mark.parametrize("half_angle_rad", [0.5, 0.8, 1.1])
def test_a_scissor_moves_at_the_friction_over_its_geometry(half_angle_rad: float) -> None:
    """Virtual work: F dh = f dd, and dd/dh = h/d = tan of half the angle."""
    model = scissor(half_angle_rad, dry_N=FRICTION_N)
    needed = FRICTION_N * np.tan(half_angle_rad)
    # The stiff sides give in a little first.
    assert abs(squeezed(model, 0.95 * needed, after_s=0.1, seconds=0.1)) < 0.002
    assert squeezed(model, 1.2 * needed, after_s=0.0, seconds=0.05) > 0.1


def test_a_scissor_with_viscous_friction_moves_at_force_over_damping() -> None:
    half_angle, damping, force = 0.8, 20.0, 0.02
    model = scissor(half_angle, viscous_Ns_per_m=damping)
    expected = force / (damping * np.tan(half_angle) ** 2)
    assert squeezed(model, force, after_s=0.1, seconds=0.2) == pytest.approx(expected, rel=0.03)


def worm(changes: dict[str, float]) -> mujoco.MjModel:
    return build_spec(load_config("riddle2023-rods", changes)).compile()


def test_without_friction_the_model_is_unchanged() -> None:
    plain, zero = worm({}), worm({"body.joints.dry_friction_Nm": 0.0})
    assert plain.ntendon == zero.ntendon
    assert not plain.tendon_frictionloss.any()


def test_a_torque_at_the_crossings_becomes_the_force_of_the_same_work() -> None:
    torque, viscous = 0.01, 0.02
    config = load_config(
        "riddle2023-rods",
        {"body.joints.dry_friction_Nm": torque, "body.joints.viscous_friction_Nms_per_rad": viscous},
    )
    assert isinstance(config.body, WormBody)
    geometry = config.body.geometry()
    model = build_spec(config).compile()
    lines = [i for i in range(model.ntendon) if model.tendon(i).name.startswith("diagonal_")]
    assert len(lines) == len(geometry.rhombi) == (len(geometry.plane_x_m) - 2) * 6
    # A flat scissor of the same sides: the change of its axial diagonal with the angle at rest, by differences.
    front, left, _, right = geometry.crossings_m[geometry.rhombi[0]]
    hoop = np.linalg.norm(left - right)
    side = np.hypot(hoop, 0.08) / 2
    angle = 2 * np.arcsin(hoop / 2 / side)
    lengthening = side * 2 * (np.cos((angle - 1e-4) / 2) - np.cos((angle + 1e-4) / 2)) / 2e-4
    assert model.tendon_frictionloss[lines] == pytest.approx(torque / lengthening, rel=1e-6)
    assert np.ravel(model.tendon_damping[lines]) == pytest.approx(viscous / lengthening**2, rel=1e-6)
    assert front.shape == (3,)
