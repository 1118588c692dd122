"""The 3D worm's energies: what its muscles have done and where it went, step by step, and what its springs store.

An actuator's work in a step is the mean of its tensions at both ends times the shortening between them; what dampers,
contacts and motors take is the mean of their powers at both ends times the step. So all of it converges in proportion
to the square of the step, also where power jumps up and decays slowly. What is left of the muscles' work when
everything else is subtracted is what the integrator has taken (docs/gait.md). Forces are the engine's own: weight,
constraints, dampers, springs, and actuators, which `discrete` takes at the end of the step to first order.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from annelid.body.actuators import ActuatorKind
from annelid.body.rows import Ties
from annelid.morphology import Array

Engine = Mapping[str, NDArray[Any]]
"""The engine's arrays of one worm by name."""


class EnergyTotals(NamedTuple):
    """Work done and energy lost since the start, J."""

    muscle_work: Array  # net work of every ring actuator on the body, (n_muscles,)
    positive_work: Array  # what each did in the physics steps in which its work was positive, likewise
    damping_loss: Array  # what dampers have taken, ()
    constraint_loss: Array  # what contacts, their friction included, and other constraints have taken, ()
    motor_energy: Array  # what motors have taken from their battery, (n_muscles,); zero for actuators that are none

    @classmethod
    def zero(cls, n_muscles: int) -> EnergyTotals:
        """Returns the totals before the first step."""
        return cls(np.zeros(n_muscles), np.zeros(n_muscles), np.zeros(()), np.zeros(()), np.zeros(n_muscles))

    def plus(self, step: EnergyTotals) -> EnergyTotals:
        """Returns the totals after one more step."""
        return EnergyTotals(*map(np.add, self, step))


class Powers(NamedTuple):
    """What acts at one instant."""

    tension: Array  # of every ring actuator, N, (n_muscles,)
    damping: float  # that dampers take, W
    constraint: float  # that contacts, their friction included, and other constraints take, W
    motor: Array  # that motors take from their battery, W, (n_muscles,); zero for actuators that are none

    @classmethod
    def none(cls, n_muscles: int) -> Powers:
        """Returns those of a worm that rests."""
        return cls(np.zeros(n_muscles), 0.0, 0.0, np.zeros(n_muscles))


class EnergyMeter:
    """Reads from the engine's arrays, those named in ``outputs``, what acts at the end of a physics step."""

    outputs = (
        "qpos",
        "qvel",
        "qacc",
        "qfrc_damper",
        "qfrc_constraint",
        "actuator_force",
        "actuator_length",
        "actuator_velocity",
        "actuator_moment",
        "moment_colind",
        "moment_rowadr",
    )

    def __init__(self, model: mujoco.MjModel, rings: ActuatorKind, ties: Ties | None = None) -> None:
        """Takes a compiled worm, and its pins' ties."""
        self._ties = ties
        self._engine_s = float(model.opt.timestep)
        # Other integrators take the actuators' forces as they are at the start of a step.
        implicit = model.opt.integrator == int(mujoco.mjtIntegrator.mjINT_DISCRETE)
        self.slopes = rings.slopes(model) if implicit else None
        self._dof_damping = model.dof_damping.copy() if implicit and model.dof_damping.any() else None
        self.motor_power = rings.motor_power(model)

    def read(self, engine: Engine, drive: Array, rods: tuple[float, float] = (0.0, 0.0)) -> Powers:
        """Returns what acts at the end of a step.

        Args:
            engine: The engine's arrays of one worm after the step.
            drive: What the actuators' gain was multiplied by during it, ``(n_muscles,)``.
            rods: Power that the material of rods takes, and the whole power that their rows take, W.
        """
        velocity = engine["qvel"]
        # Rates of the actuators' lengths, m/s, with the lever arms of the step.
        products = engine["actuator_moment"] * velocity[engine["moment_colind"]]
        rate, earlier = np.add.reduceat(products, engine["moment_rowadr"]), engine["actuator_velocity"]
        tension = -engine["actuator_force"]
        if self.slopes is not None:
            per_length, per_rate = self.slopes(engine["actuator_length"], earlier, drive, tension)
            tension = tension + per_length * (self._engine_s * rate) + per_rate * (rate - earlier)
        damper = engine["qfrc_damper"]
        if self._dof_damping is not None:
            damper = damper - self._dof_damping * (self._engine_s * engine["qacc"])
        damped, constrained = -float(damper @ velocity), -float(engine["qfrc_constraint"] @ velocity)
        # The engine counts rows among its constraints.
        damped, constrained = damped + rods[0], constrained - rods[1]
        if self._ties is not None:
            springs, dashpots = self._ties.power_W(engine["qpos"], velocity)
            damped, constrained = damped + dashpots, constrained - dashpots - springs
        taken = np.zeros_like(tension) if self.motor_power is None else self.motor_power(tension, -rate)
        return Powers(tension, damped, constrained, taken)


def done_in(time_s: float, shortening_m: Array, before: Powers, after: Powers) -> EnergyTotals:
    """Returns what a step has done in which the ring actuators shortened, ``(n_muscles,)``, between two instants."""
    work = 0.5 * (before.tension + after.tension) * shortening_m
    half_s = 0.5 * time_s
    return EnergyTotals(
        work,
        np.maximum(work, 0.0),
        np.asarray(half_s * (before.damping + after.damping)),
        np.asarray(half_s * (before.constraint + after.constraint)),
        half_s * (before.motor + after.motor),
    )


class Elasticity:
    """The elastic energy of one compiled body as a function of its coordinates, without that of rods."""

    def __init__(self, model: mujoco.MjModel, ties: Ties | None) -> None:
        self._ties = ties
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
        energy = 0.5 * float(self._spring_rate @ (stretch * stretch) + self._joint_rate @ (angle * angle))
        return energy + (0.0 if self._ties is None else self._ties.energy_J(qpos))
