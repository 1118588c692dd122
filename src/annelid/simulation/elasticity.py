"""The energy that a 3D worm's strands, joints and springs hold, which the engine does not tell for rods.

A rod is the engine's discrete elastic rod (Bergou et al. 2008, "Discrete elastic rods"). An edge e carries a unit
tangent t and a reference direction u across it, which the engine transports along in time without twist and keeps as
"plastic" state; its material frame is that direction turned by the angle q of its twist hinge. Between two edges of
rest lengths l and l', the rod holds

    E I / (l + l') * mean over both edges of |k - k0|^2  +  G J / (l + l') * (q' - q + w)^2

where ``k = 2 t x t' / (1 + t . t')`` is the curvature, seen in the edge's material frame, k0 the same at rest, and w
the turn from the reference direction of one edge, transported to the other, to that one's. That this is the energy
behind the engine's forces is held by `tests/simulation/test_elasticity.py`.
"""

from __future__ import annotations

from math import pi

import mujoco
import numpy as np
from numpy.typing import NDArray

from annelid.body.worm import WormBody
from annelid.morphology import Array

Seen = NDArray[np.complex128]
_NUMBERS_PER_EDGE = 6
"""Plastic state of an edge: its tangent and its reference direction when they were last transported."""


class Elasticity:
    """The elastic energy of one compiled body as a function of its coordinates."""

    def __init__(self, model: mujoco.MjModel, body: WormBody) -> None:
        """Finds springs, rods and joints with stiffness.

        Args:
            model: The compiled body.
            body: Its configuration.
        """
        springs = [model.tendon(f"spring_{i}").id for i in range(_count(model, "spring_"))]
        self._spring_rate = model.tendon_stiffness[springs].copy()
        self._spring_slack = model.tendon_lengthspring[springs].T.copy()
        self._rods = _Rods(model, body) if model.nflex else None
        self._joints = _Joints(model)

    def energy_J(self, qpos: Array, plastic: Array, spring_length_m: Array) -> float:
        """Tells the energy at one instant, J, zero where nothing is bent, twisted or stretched.

        Args:
            qpos: The engine's generalised positions, ``(nq,)``.
            plastic: Its plastic state, ``(nplastic,)``, all zero before the first step.
            spring_length_m: Lengths of the axial springs, m, ``(n_springs,)``.
        """
        stretch = spring_length_m - spring_length_m.clip(*self._spring_slack)
        energy = 0.5 * float(self._spring_rate @ (stretch * stretch)) + self._joints.energy_J(qpos)
        return energy if self._rods is None else energy + self._rods.energy_J(qpos, plastic)


def _count(model: mujoco.MjModel, prefix: str) -> int:
    """Number of tendons whose name begins with a prefix."""
    return sum(model.tendon(i).name.startswith(prefix) for i in range(model.ntendon))


class _Joints:
    """Stiff hinges and ball joints."""

    def __init__(self, model: mujoco.MjModel) -> None:
        stiff = model.jnt_stiffness > 0
        hinges = np.flatnonzero(stiff & (model.jnt_type == int(mujoco.mjtJoint.mjJNT_HINGE)))
        balls = np.flatnonzero(stiff & (model.jnt_type == int(mujoco.mjtJoint.mjJNT_BALL)))
        self._angle = model.jnt_qposadr[hinges]
        self._angle_at_rest = model.qpos_spring[self._angle]
        self._turn = model.jnt_qposadr[balls][:, None] + np.arange(4)
        self._turn_at_rest = model.qpos_spring[self._turn]
        self._rates = model.jnt_stiffness[hinges], model.jnt_stiffness[balls]

    def energy_J(self, qpos: Array) -> float:
        hinge = qpos[self._angle] - self._angle_at_rest
        now, rest = qpos[self._turn].T, self._turn_at_rest.T
        # The turn from rest is a product of quaternions; half its angle has this cosine and the sine of what is left.
        cosine = np.abs((now * rest).sum(axis=0))
        vector = rest[0] * now[1:] - now[0] * rest[1:] - _cross(rest[1:], now[1:])
        ball = 2.0 * np.arctan2(np.sqrt(_dot(vector, vector)), cosine)
        return 0.5 * float(self._rates[0] @ (hinge * hinge) + self._rates[1] @ (ball * ball))


class _Rods:
    """All strands of a net, which have as many edges each; arrays are ``(axis, strand, edge)``."""

    def __init__(self, model: mujoco.MjModel, body: WormBody) -> None:
        n_edges = int(model.flex_edgenum[0])
        self._shape = (model.nflex, n_edges)
        strands = range(model.nflex)
        vertices = model.flex_vertbodyid.reshape(model.nflex, n_edges + 1)
        # A vertex sits on three slides along the world's axes.
        slides = model.jnt_qposadr[model.body_jntadr[vertices]]
        self._slide = slides + np.arange(3)[:, None, None]
        self._place = model.body_pos[vertices].transpose(2, 0, 1).copy()
        hinges = [[f"strand_{s}_twist_{e}" for e in range(n_edges - 1)] + [f"strand_{s}_twist"] for s in strands]
        self._hinge = np.array([[model.joint(name).qposadr[0] for name in names] for names in hinges])
        lengths = model.flexedge_length0.reshape(self._shape)
        per_length = pi * body.strands.radius_m**4 / (lengths[:, :-1] + lengths[:, 1:])
        self._bending = body.strands.young_modulus_Pa * per_length / 4
        self._torsion = body.strands.shear_modulus_Pa * per_length / 2
        self._frames_at_rest = self._frames(plastic_at_rest(model))
        tangent, direction, _ = self._frames_at_rest
        self._seen_at_rest = _Neighbours(tangent, direction).seen(np.zeros(self._shape))

    def energy_J(self, qpos: Array, plastic: Array) -> float:
        edge = np.diff(self._place + qpos[self._slide], axis=-1)
        tangent = edge / np.sqrt(_dot(edge, edge))
        old_tangent, old_direction, turns = self._frames(plastic) if plastic.any() else self._frames_at_rest
        # Transport in time: what is across the old tangent turns with the least turn from the old to the new.
        lean = _dot(tangent, old_direction) / (1.0 + _dot(tangent, old_tangent))
        direction = old_direction - (old_tangent + tangent) * lean
        angle = qpos[self._hinge]
        neighbours = _Neighbours(tangent, direction)
        turn = neighbours.turn()
        # A rod may be wound by more than half a turn between two edges.
        turn += 2 * pi * np.rint((turns - turn) / (2 * pi))
        twist = angle[:, 1:] - angle[:, :-1] + turn
        bent = neighbours.seen(angle) - self._seen_at_rest
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
    """Returns the plastic state of rods that are turned as a whole, ``(nplastic,)``.

    Args:
        model: A compiled body.
        plastic: The state before, ``(nplastic,)``.
        turn: Rotation matrix, ``(3, 3)``.
    """
    if not model.nplastic:
        return plastic
    turned = plastic.reshape(model.nflex, -1).copy()
    axes = turned[:, : _NUMBERS_PER_EDGE * int(model.flex_edgenum[0])]
    axes[:] = (axes.reshape(-1, 3) @ turn.T).reshape(axes.shape)
    return turned.reshape(-1)


class _Neighbours:
    """Neighbouring edges by the scalar products of their axes: tangent, direction, and the vector across both."""

    def __init__(self, tangent: Array, direction: Array) -> None:
        axes = np.stack([tangent, direction, _cross(tangent, direction)])
        self._product = np.einsum("piab,qiab->pqab", axes[..., :-1], axes[..., 1:])
        self._scale = 1.0 / (1.0 + self._product[0, 0])

    def turn(self) -> Array:
        """Angle from the direction of the one in front, transported to the one behind, to that one's."""
        lean = self._product[1, 0] * self._scale
        along, across = (self._product[1, axis] - self._product[0, axis] * lean for axis in (1, 2))
        return np.arctan2(-across, along)

    def seen(self, angle: Array) -> Seen:
        """Curvature in the material frame of the edge in front, and of the one behind, ``(2, strand, edge - 1)``.

        The real part is that along the direction turned by the edge's angle, the imaginary part that across it.
        """
        product, turned = self._product, np.exp(-1j * angle)
        front = (1j * product[1, 0] - product[2, 0]) * turned[:, :-1]
        rear = (product[0, 2] - 1j * product[0, 1]) * turned[:, 1:]
        return 2.0 * self._scale * np.stack([front, rear])


def _dot(a: Array, b: Array) -> Array:
    """Scalar products over the first axis."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Array, b: Array) -> Array:
    """Vector products over the first axis."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
    return out
