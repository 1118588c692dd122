"""Strands of both formulations against the closed forms of a straight elastic rod."""

from __future__ import annotations

from math import pi

import mujoco
import numpy as np
import pytest

from annelid.body.formulations.chain.capsules import add_chain
from annelid.body.mesh import Strands
from cantilevers import RodCantilever

LENGTH_M = 0.6
ELEMENTS = 24
ELEMENT_M = LENGTH_M / ELEMENTS
STRANDS = Strands(damping_time_s=0.13)
BENDING = STRANDS.one_number("young_modulus_Pa") * pi * STRANDS.radius_m**4 / 4
TORSION = STRANDS.one_number("shear_modulus_Pa") * pi * STRANDS.radius_m**4 / 2
VERTICES = np.stack([np.linspace(0, LENGTH_M, ELEMENTS + 1), np.zeros(ELEMENTS + 1), np.zeros(ELEMENTS + 1)], axis=-1)


STEP = 12
"""Inner vertices up to the step of a strand that is stiff in front and soft behind, `SOFTER` of it in bending."""
SOFTER = 0.25
STEPPED = np.where(np.arange(1, ELEMENTS) <= STEP, [[1.0], [1.0]], [[SOFTER], [0.5]])


def settled(rod: RodCantilever, seconds: float) -> None:
    for _ in range(round(seconds / (1.5 * rod.model.opt.timestep))):
        rod.two_step.step(lambda: None)
    mujoco.mj_kinematics(rod.model, rod.data)
    assert np.abs(rod.data.qvel).max() < 2e-4, "the rod has not come to rest"


def chain_cantilever(shares: np.ndarray | None = None) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.option.gravity = [0, 0, 0]
    spec.option.timestep = 0.005
    add_chain(spec, "rod", VERTICES, STRANDS, 1e-5, root=0, fixed_root=True, shares=shares)
    return spec.compile()


def settle(model: mujoco.MjModel, data: mujoco.MjData, seconds: float) -> None:
    mujoco.mj_step(model, data, round(seconds / model.opt.timestep))
    mujoco.mj_kinematics(model, data)
    assert np.abs(data.qvel).max() < 2e-4, "the rod has not come to rest"


def apply_at_rest(model: mujoco.MjModel, data: mujoco.MjData, body: int, load_N: float) -> None:
    """Loads the tip of the last element with a vertical force, as a wrench on its centre of mass at rest."""
    mujoco.mj_forward(model, data)
    data.xfrc_applied[body, 2] = load_N
    data.xfrc_applied[body, 4] = -load_N * (VERTICES[-1, 0] - data.xipos[body, 0])


def tip_deflection(load_N: float, shares: np.ndarray | None = None) -> float:
    """Euler-Bernoulli, clamped in the middle of the first element, whose direction is held; with a step or without."""
    whole, behind = LENGTH_M - ELEMENT_M / 2, LENGTH_M - (STEP + 0.5) * ELEMENT_M
    softer = 1.0 if shares is None else SOFTER
    return load_N * (whole**3 - behind**3 + behind**3 / softer) / (3 * BENDING)


@pytest.mark.parametrize("shares", [None, STEPPED], ids=["even", "stepped"])
def test_tip_of_a_rod_cantilever_follows_beam_theory(shares: np.ndarray | None) -> None:
    rod = RodCantilever(VERTICES, STRANDS, 0.005, shares)
    load, data = 2e-4, rod.data
    tip = rod.model.body(f"v{ELEMENTS}").id
    data.xfrc_applied[tip, 2] = load
    settled(rod, 8.0)
    assert data.xpos[tip, 2] == pytest.approx(tip_deflection(load, shares), rel=0.01)


@pytest.mark.parametrize("shares", [None, STEPPED], ids=["even", "stepped"])
def test_tip_of_a_chain_cantilever_follows_beam_theory(shares: np.ndarray | None) -> None:
    model = chain_cantilever(shares)
    data = mujoco.MjData(model)
    load = 2e-4
    last = model.body(f"rod_{ELEMENTS - 1}").id
    apply_at_rest(model, data, last, load)
    settle(model, data, 20.0)
    tip = data.xpos[last] + data.xmat[last].reshape(3, 3) @ [ELEMENT_M, 0, 0]
    assert tip[2] == pytest.approx(tip_deflection(load, shares), rel=0.01)


@pytest.mark.parametrize(("shares", "softer"), [(None, 1.0), (STEPPED, 0.5)], ids=["even", "stepped"])
def test_a_twisted_rod_turns_by_torque_times_length_over_torsion_stiffness(
    shares: np.ndarray | None, softer: float
) -> None:
    rod = RodCantilever(VERTICES, STRANDS, 0.005, shares)
    torque, hinge = 2e-3, rod.model.joint("strand_0_twist")
    rod.data.qfrc_applied[hinge.dofadr[0]] = torque
    settled(rod, 2.0)
    turned = rod.data.qpos[hinge.qposadr[0]]
    behind = LENGTH_M - (STEP + 0.5) * ELEMENT_M - ELEMENT_M / 2
    compliance = (LENGTH_M - ELEMENT_M - behind + behind / softer) / TORSION
    assert turned == pytest.approx(torque * compliance, rel=0.01)


def test_a_twisted_chain_of_hinges_turns_by_the_same() -> None:
    model = chain_cantilever()
    data = mujoco.MjData(model)
    torque = 2e-3
    data.xfrc_applied[model.body(f"rod_{ELEMENTS - 1}").id, 3] = torque
    settle(model, data, 10.0)
    last = data.xmat[model.body(f"rod_{ELEMENTS - 1}").id].reshape(3, 3)
    turned = np.arctan2(last[2, 1], last[1, 1])
    assert turned == pytest.approx(torque * (LENGTH_M - ELEMENT_M) / TORSION, rel=0.01)
