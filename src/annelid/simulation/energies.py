"""The 3D worm's energies: what its muscles have done and where it went, step by step, and what its strands store.

The engine moves the body by the step h times the new velocity v', and the work of a generalised force f in a step is
``h f . v'``. With the mass matrix M constant, as it is for point masses on slides,

    change of kinetic energy = work of all forces - 1/2 |v' - v|^2_M

is exact to rounding. Forces are the engine's own: weight, constraints, dampers, springs, actuators. The integrator
`discrete` takes springs, dampers and actuators at the end of the step to first order, with simpler matrices than
theirs. What that takes beyond the true change of elastic energy and the dampers' own work, and the square above, is the
numerical loss. It is what is left of the muscles' work when everything else is subtracted (docs/gait.md).

The engine gives no elastic energy of rods. A rod is the engine's discrete elastic rod (Bergou et al. 2008, "Discrete
elastic rods"). An edge e carries a unit tangent t and a reference direction u across it, which the engine transports
along in time without twist and keeps as "plastic" state; its material frame is that direction turned by the angle q of
its twist hinge. Between two edges of rest lengths l and l', the rod stores

    E I / (l + l') * mean over both edges of |k - k0|^2  +  G J / (l + l') * (q' - q + w)^2

where ``k = 2 t x t' / (1 + t . t')`` is the curvature, seen in the edge's material frame, k0 the same at rest, and w
the turn from the reference direction of one edge, transported to the other, to that one's. That this is the energy
behind the engine's forces is tested in `tests/simulation/test_elasticity.py`.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from annelid.body.actuators import ActuatorKind
from annelid.body.damping import MaterialDamping, RodVertices, Ties, rod_stiffness, twist_joints
from annelid.body.worm import WormBody
from annelid.morphology import Array, cross

Engine = Mapping[str, NDArray[Any]]
"""The engine's arrays of one worm by name."""
_NUMBERS_PER_EDGE = 6
"""Plastic state of an edge: its tangent and its reference direction when they were last transported."""


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


class EnergyMeter:
    """Reads from the engine's arrays, those named in ``outputs``, what one physics step did."""

    outputs = (
        "qpos",
        "qvel",
        "qfrc_damper",
        "qfrc_constraint",
        "actuator_force",
        "actuator_length",
        "actuator_velocity",
        "actuator_moment",
        "moment_colind",
        "moment_rowadr",
    )

    def __init__(
        self, model: mujoco.MjModel, rings: ActuatorKind, engine_share: float = 1.0, ties: Ties | None = None
    ) -> None:
        """Takes a compiled worm, the length of the engine's step over that of a whole step, and its pins' ties."""
        self._ties = ties
        self._engine_s = float(model.opt.timestep)
        self._timestep_s = self._engine_s / engine_share
        # Other integrators take the actuators' forces as they are at the start of a step.
        implicit = model.opt.integrator == int(mujoco.mjtIntegrator.mjINT_DISCRETE)
        self.slopes = rings.slopes(model) if implicit else None
        self.motor_power = rings.motor_power(model)

    def step(self, engine: Engine, drive: Array, dampers: MaterialDamping | None = None) -> tuple[Array, EnergyTotals]:
        """Returns the tension of every ring actuator over one step, N, ``(n_muscles,)``, and what the step did.

        An actuator's work is its tension times the shortening. Given are the engine's arrays of one worm after the
        step, what the actuators' gain was multiplied by during it, ``(n_muscles,)``: the control, or the engine's
        actuator states before the step where there are any; and the rows that damp this worm's material, if any.
        """
        velocity, h = engine["qvel"], self._timestep_s
        # Rates of the actuators' lengths, m/s, with the lever arms of the step.
        products = engine["actuator_moment"] * velocity[engine["moment_colind"]]
        rate, earlier = np.add.reduceat(products, engine["moment_rowadr"]), engine["actuator_velocity"]
        tension = -engine["actuator_force"]
        if self.slopes is not None:
            per_length, per_rate = self.slopes(engine["actuator_length"], earlier, drive, tension)
            tension = tension + per_length * (self._engine_s * rate) + per_rate * (rate - earlier)
        work = -h * tension * rate
        damped, constrained = (-h * (engine[force] @ velocity) for force in ("qfrc_damper", "qfrc_constraint"))
        # The engine counts the rows of dampers and ties among its constraints.
        if dampers is not None:
            loss = h * dampers.loss_W(velocity)
            damped, constrained = damped + loss, constrained - loss
        if self._ties is not None:
            springs, dashpots = (h * power for power in self._ties.power_W(engine["qpos"], velocity))
            damped, constrained = damped + dashpots, constrained - dashpots - springs
        taken = np.zeros_like(work) if self.motor_power is None else h * self.motor_power(tension, -rate)
        return tension, EnergyTotals(work, np.maximum(work, 0.0), damped, constrained, taken)


class Elasticity:
    """The elastic energy of one compiled body as a function of its coordinates."""

    def __init__(self, model: mujoco.MjModel, body: WormBody, ties: Ties | None) -> None:
        self._ties = ties
        springs = [i for i in range(model.ntendon) if model.tendon(i).name.startswith("spring_")]
        self._spring_rate = model.tendon_stiffness[springs].copy()
        self._spring_slack = model.tendon_lengthspring[springs].T.copy()
        stiff = model.jnt_stiffness > 0
        # Slides are those of a scene; a vertex' own have no stiffness.
        scalar = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
        hinges = np.flatnonzero(stiff & np.isin(model.jnt_type, scalar))
        balls = np.flatnonzero(stiff & (model.jnt_type == int(mujoco.mjtJoint.mjJNT_BALL)))
        self._angle = model.jnt_qposadr[hinges]
        self._angle_at_rest = model.qpos_spring[self._angle]
        self._turn = model.jnt_qposadr[balls][:, None] + np.arange(4)
        self._turn_at_rest = model.qpos_spring[self._turn]
        self._rates = model.jnt_stiffness[hinges], model.jnt_stiffness[balls]
        self._rods = _Rods(model, body) if model.nflex else None

    def energy_J(self, qpos: Array, plastic: Array, spring_length_m: Array) -> float:
        """Returns the energy at one instant, J, zero where nothing is bent, twisted or stretched.

        Given are the engine's generalised positions, ``(nq,)``, and plastic state, ``(nplastic,)``, all zero before the
        first step, and the lengths of the axial springs, m, ``(n_springs,)``.
        """
        stretch = spring_length_m - spring_length_m.clip(*self._spring_slack)
        hinge = qpos[self._angle] - self._angle_at_rest
        now, rest = qpos[self._turn].T, self._turn_at_rest.T
        # The turn from rest is a product of quaternions; half its angle has this cosine and the sine of what is left.
        cosine = np.abs((now * rest).sum(axis=0))
        vector = rest[0] * now[1:] - now[0] * rest[1:] - cross(rest[1:], now[1:])
        ball = 2.0 * np.arctan2(np.sqrt(_dot(vector, vector)), cosine)
        joints = 0.5 * float(self._rates[0] @ (hinge * hinge) + self._rates[1] @ (ball * ball))
        energy = 0.5 * float(self._spring_rate @ (stretch * stretch)) + joints
        energy += 0.0 if self._ties is None else self._ties.energy_J(qpos)
        return energy if self._rods is None else energy + self._rods.energy_J(qpos, plastic)


class _Rods:
    """All strands of a net, which have as many edges each; arrays are ``(axis, strand, edge)``."""

    def __init__(self, model: mujoco.MjModel, body: WormBody) -> None:
        n_edges = int(model.flex_edgenum[0])
        self._shape = (model.nflex, n_edges)
        self._vertices = RodVertices(model)
        self._hinge = model.jnt_qposadr[twist_joints(model)]
        self._bending, self._torsion = rod_stiffness(model, body.strands)
        self._frames_at_rest = self._frames(plastic_at_rest(model))
        tangent, direction, _ = self._frames_at_rest
        self._seen_at_rest = _seen(*_neighbours(tangent, direction), np.zeros(self._shape))

    def energy_J(self, qpos: Array, plastic: Array) -> float:
        edge = np.diff(self._vertices.at(qpos), axis=-1)
        tangent = edge / np.sqrt(_dot(edge, edge))
        old_tangent, old_direction, turns = self._frames(plastic) if plastic.any() else self._frames_at_rest
        # Transport in time: what is across the old tangent turns with the least turn from the old to the new.
        lean = _dot(tangent, old_direction) / (1.0 + _dot(tangent, old_tangent))
        direction = old_direction - (old_tangent + tangent) * lean
        angle = qpos[self._hinge]
        product, scale = _neighbours(tangent, direction)
        # The angle from the direction of the edge in front, transported to the one behind, to that one's.
        lean = product[1, 0] * scale
        along, across = (product[1, axis] - product[0, axis] * lean for axis in (1, 2))
        turn = np.arctan2(-across, along)
        # A rod may be wound by more than half a turn between two edges.
        turn += 2 * pi * np.rint((turns - turn) / (2 * pi))
        twist = angle[:, 1:] - angle[:, :-1] + turn
        bent = _seen(product, scale, angle) - self._seen_at_rest
        squares = 0.5 * (bent.real**2 + bent.imag**2).sum(axis=0)
        return float((self._bending * squares + self._torsion * twist * twist).sum())

    def _frames(self, plastic: Array) -> tuple[Array, Array, Array]:
        """Splits plastic state: tangents and directions, ``(3, strand, edge)``, and turns, ``(strand, edge - 1)``."""
        n_strands, n_edges = self._shape
        by_strand = plastic.reshape(n_strands, -1)
        frames = by_strand[:, : _NUMBERS_PER_EDGE * n_edges].reshape(n_strands, n_edges, 2, 3).transpose(2, 3, 0, 1)
        return frames[0].copy(), frames[1].copy(), by_strand[:, _NUMBERS_PER_EDGE * n_edges :]


def plastic_at_rest(model: mujoco.MjModel) -> Array:
    """Returns the frames that the engine gives the edges where they are at rest, ``(nplastic,)``."""
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data)
    return data.plastic.copy()


def turned_frames(model: mujoco.MjModel, plastic: Array, turn: Array) -> Array:
    """Returns the plastic state of rods, ``(nplastic,)``, turned as a whole by a rotation matrix, ``(3, 3)``."""
    if not model.nplastic:
        return plastic
    turned = plastic.reshape(model.nflex, -1).copy()
    axes = turned[:, : _NUMBERS_PER_EDGE * int(model.flex_edgenum[0])]
    axes[:] = (axes.reshape(-1, 3) @ turn.T).reshape(axes.shape)
    return turned.reshape(-1)


def _neighbours(tangent: Array, direction: Array) -> tuple[Array, Array]:
    """Scalar products of the axes of neighbouring edges, tangent, direction and the vector across both, and a scale."""
    axes = np.stack([tangent, direction, cross(tangent, direction)])
    product = np.einsum("piab,qiab->pqab", axes[..., :-1], axes[..., 1:])
    return product, 1.0 / (1.0 + product[0, 0])


def _seen(product: Array, scale: Array, angle: Array) -> NDArray[np.complex128]:
    """Curvature in the material frame of the edge in front, and of the one behind, ``(2, strand, edge - 1)``.

    The real part is that along the direction turned by the edge's angle, the imaginary part that across it.
    """
    turned: NDArray[np.complex128] = np.exp(-1j * angle)
    front = (1j * product[1, 0] - product[2, 0]) * turned[:, :-1]
    rear = (product[0, 2] - 1j * product[0, 1]) * turned[:, 1:]
    seen: NDArray[np.complex128] = np.stack([front, rear])
    return seen * (2.0 * scale)


def _dot(a: Array, b: Array) -> Array:
    """Scalar products over the first axis."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
