"""The 3D worm's energies: what its muscles have done and where it went, step by step, and what its springs store.

An actuator's work in a step is the mean of its tensions at both ends times the shortening between them; what dampers
and contacts take is the mean of their powers at both ends times the step. So all of it converges in proportion
to the square of the step, also where power jumps up and decays slowly. What is left of the muscles' work when
everything else is subtracted is what the integrator has taken (docs/evidence/gait.md). Forces are the engine's own:
weight, constraints, dampers, springs, and actuators, which `discrete` takes at the end of the step to first order.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import mujoco
import numpy as np

from annelid.body.actuators import ActuatorKind
from annelid.morphology import Array


class EnergyTotals(NamedTuple):
    """Work done and energy lost since the start, J."""

    muscle_work: Array  # net work of every ring actuator on the body, (n_muscles,)
    positive_work: Array  # what each did in the physics steps in which its work was positive, likewise
    damping_loss: Array  # what dampers have taken, ()
    constraint_loss: Array  # what contacts with their friction, other constraints and outside forces have taken, ()

    @classmethod
    def zero(cls, n_muscles: int) -> EnergyTotals:
        """Returns the totals before the first step."""
        return cls(np.zeros(n_muscles), np.zeros(n_muscles), np.zeros(()), np.zeros(()))

    def plus(self, step: EnergyTotals) -> EnergyTotals:
        """Returns the totals after one more step."""
        return EnergyTotals(*map(np.add, self, step))


class Powers(NamedTuple):
    """What acts at one instant."""

    tension: Array  # of every ring actuator, N, (n_muscles,)
    damping: float  # that dampers take, W
    constraint: float  # that contacts, their friction included, and other constraints take, W

    @classmethod
    def none(cls, n_muscles: int) -> Powers:
        """Returns those of a worm that rests."""
        return cls(np.zeros(n_muscles), 0.0, 0.0)


class EnergyMeter:
    """Reads what acts at the end of a physics step."""

    def __init__(self, model: mujoco.MjModel, rings: ActuatorKind) -> None:
        """Takes a compiled worm."""
        self._engine_s = float(model.opt.timestep)
        # Other integrators take the actuators' forces as they are at the start of a step.
        implicit = model.opt.integrator == int(mujoco.mjtIntegrator.mjINT_DISCRETE)
        self.slopes = rings.slopes(model) if implicit else None
        self._dof_damping = model.dof_damping.copy() if implicit and model.dof_damping.any() else None

    def read(self, data: mujoco.MjData, drive: Array, losses_W: Iterable[tuple[float, float]] = ()) -> Powers:
        """Returns what acts at the end of a step.

        Args:
            data: The engine's data after the step.
            drive: What the actuators' gain was multiplied by during it, ``(n_muscles,)``.
            losses_W: What is lost to dampers, and taken for that of constraints, as `Mechanics.losses_W` yields it.
        """
        velocity = data.qvel
        # Rates of the actuators' lengths, m/s, with the lever arms of the step.
        products = data.actuator_moment * velocity[data.moment_colind]
        rate, earlier = np.add.reduceat(products, data.moment_rowadr), data.actuator_velocity
        tension = -data.actuator_force
        if self.slopes is not None:
            per_length, per_rate = self.slopes(data.actuator_length, earlier, drive, tension)
            tension = tension + per_length * (self._engine_s * rate) + per_rate * (rate - earlier)
        damper = data.qfrc_damper
        if self._dof_damping is not None:
            damper = damper - self._dof_damping * (self._engine_s * data.qacc)
        damped, constrained = 0.0 - float(damper @ velocity), -float(data.qfrc_constraint @ velocity)
        for of_damper, of_constraint in losses_W:
            damped, constrained = damped + of_damper, constrained - of_constraint
        return Powers(tension, damped, constrained)


def work_in_step(time_s: float, shortening_m: Array, before: Powers, after: Powers) -> EnergyTotals:
    """Returns what a step has done in which the ring actuators shortened, ``(n_muscles,)``, between two instants."""
    work = 0.5 * (before.tension + after.tension) * shortening_m
    half_s = 0.5 * time_s
    return EnergyTotals(
        work,
        np.maximum(work, 0.0),
        np.asarray(half_s * (before.damping + after.damping)),
        np.asarray(half_s * (before.constraint + after.constraint)),
    )


class Elasticity:
    """The elastic energy of one compiled body as a function of its coordinates, without that of rods and ties."""

    def __init__(self, model: mujoco.MjModel) -> None:
        springs = [i for i in range(model.ntendon) if model.tendon(i).name.startswith("spring_")]
        self._spring_rate = model.tendon_stiffness[springs].copy()
        self._spring_slack = model.tendon_lengthspring[springs].T.copy()
        # Slides are those of a scene; a vertex' own have no stiffness.
        scalar = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
        joints = np.flatnonzero((model.jnt_stiffness > 0) & np.isin(model.jnt_type, scalar))
        self._angle = model.jnt_qposadr[joints]
        self._angle_at_rest = model.qpos_spring[self._angle]
        self._joint_rate = model.jnt_stiffness[joints]

    def energy_J(self, qpos: Array, spring_length_m: Array) -> float:
        """Returns the energy at one instant, J, zero where nothing is bent or stretched.

        Given are the engine's generalised positions, ``(nq,)``, and the lengths of the axial springs, m,
        ``(n_springs,)``.
        """
        stretch = spring_length_m - spring_length_m.clip(*self._spring_slack)
        angle = qpos[self._angle] - self._angle_at_rest
        return 0.5 * float(self._spring_rate @ (stretch * stretch) + self._joint_rate @ (angle * angle))
