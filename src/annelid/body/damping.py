"""Springs and dampers of rods that the engine lacks: across the plane in which a vertex is bent, and at their pins.

The engine damps the rate of a vertex' curvature ``2 tan(h)``, where h is half the angle between its two edges, but not
the rate at which the plane of the bend turns in the material. With the edges' directions t0 and t1, lengths l0 and l1,
rates e0' and e1', and b the unit vector across the bend, the curvature moves sideways in the material frame of the rear
edge, whose twist hinge turns at the rate w1, by

    (cos(2h) b . e1' / l1 - b . e0' / l0) / cos(h)^2 - 2 tan(h) w1

and in that of the front edge by the same with the cosine at e0' and with w0. Either is zero in every rigid rotation.
The elastic energy takes the mean over both frames; the damping takes one of them for each vertex, that of every second
edge for the vertices at its two ends, since rows with two hinges take an eighth of a step longer. Times the material's
time and its bending stiffness, it makes bending alike in all directions (Kelvin-Voigt).

The coefficients follow the posture, step by step. As dampers of tendons they would cost twice the time of a step, and
so would the springs and dashpots that tie separate pins to their strands. A plant has constraint rows instead, which
the engine solves at the end of the step too. It scales a row by A, the ratio of the row's inverse inertia without the
forces of the step to that with them: a row's force is ``-A (I a + c v + k r)``, with the wanted damping c and stiffness
k, and a small inertance I. A depends on step, posture and the world's axes, and would be 1 to 80. So every row also
includes one dof that is fixed and so light that it alone decides about A, which then is 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from annelid.body.formulations import Tie
from annelid.body.worm import Strands
from annelid.morphology import Array, cross

HELD = "damper_reference"
HELD_MASS_KG = 1e-9
HELD_LEVER = 1e3
"""Coefficient of the held dof in every row: its share of a row's inverse inertia is 1e15, of the others 1e9 at most."""
HELD_INVERSE_KG = 1e-16
"""The engine fixes a dof by a force in proportion to the inertia that it believes it to have."""
INERTANCE = 1e-3
"""Of a row, as a share of its damping times the step, and of its stiffness times the square: nothing to be seen."""
IMPEDANCE = 0.01
STRAIGHT = 1e-9
"""Sine of the bend below which a vertex is straight; there the engine itself damps every direction."""
_DAMPER, _STIFFNESS, _TIE = "_damper_", "_stiffness", "tie_"
_PER_ROW = 10
_PER_RECORD = 10


def damper_name(rod: str, vertex: int) -> str:
    """Name of the tendon that damps a vertex of a rod."""
    return f"{rod}{_DAMPER}{vertex}"


def twist_name(rod: str, edge: int, n_edges: int) -> str:
    """Name of the twist hinge of an edge, by which the engine finds it."""
    return f"{rod}_twist" if edge == n_edges - 1 else f"{rod}_twist_{edge}"


def shares_name(rod: str) -> str:
    """Name of the numbers in a model that say how stiff a rod is along itself."""
    return f"{rod}{_STIFFNESS}"


def rod_shares(model: mujoco.MjModel) -> Array:
    """Returns the stiffness at every inner vertex of rods with as many edges each, over that of their material.

    Returns:
        Shares in bending and in twist, ``(2, n_rods, n_edges - 1)``.
    """
    shares = np.ones((2, model.nflex, int(model.flex_edgenum[0]) - 1))
    for number in range(model.nnumeric):
        one = model.numeric(number)
        rod = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_FLEX.value, one.name.removesuffix(_STIFFNESS))
        if rod >= 0 and one.name.endswith(_STIFFNESS):
            shares[:, rod] = one.data.reshape(2, -1)
    return shares


def stiffen(model: mujoco.MjModel) -> None:
    """Gives the rods of a compiled model the stiffness that its numbers say, which the engine has one of for a rod."""
    if not model.nnumeric or not model.nflex:
        return
    # After their number come the records of the inner vertices, with the stiffness in bending, across it, and in twist.
    records = model.flex_bending.reshape(model.nflex, -1)[:, 1:].reshape(model.nflex, -1, _PER_RECORD)
    bending, twist = rod_shares(model)
    for column, share in ((4, bending), (5, bending), (8, twist)):
        records[..., column] *= share


def _coefficients(lengths_m: Array, strands: Strands) -> Array:
    """Torque per rate at every inner vertex between edges of rest lengths, N m s, ``(..., n_edges - 1)``."""
    time_s = strands.material_damping_s
    assert time_s is not None
    return 2.0 * time_s * strands.bending_rigidity_Nm2 / (lengths_m[..., :-1] + lengths_m[..., 1:])


class Bends(NamedTuple):
    """How a rod is bent at its inner vertices."""

    across: Array  # unit vector across the bend over cos(h)^2, (3, ..., n_vertices - 2); zero where it is straight
    sine: Array  # of the angle 2h between the edges, (..., n_vertices - 2)
    cosine: Array  # likewise
    per_length: Array  # one over the length of every edge, 1/m, (..., n_vertices - 1)


def damped_edge(vertex: int) -> int:
    """Number of the edge in whose frame an inner vertex, from 1, is damped: that behind an odd one, before an even."""
    return vertex - 1 + vertex % 2


def damper_rows(bent: Bends) -> Array:
    """How the sideways rate of curvature follows from the rates of three vertices and a hinge.

    Args:
        bent: How the rod is bent.

    Returns:
        Coefficients of x, y, z of the vertex in front, of the vertex, of the one behind, 1/m, and of the hinge,
        ``(10, ..., n_vertices - 2)``; zero where the rod is straight.
    """
    b, sine, cosine, per_length = bent
    # Vertices 1, 3, 5 are damped in the frame of the edge behind, the others in that of the edge in front.
    in_rear = np.arange(1, sine.shape[-1] + 1) % 2 == 1
    front = b * (per_length[..., :-1] * np.where(in_rear, 1.0, cosine))
    rear = b * (per_length[..., 1:] * np.where(in_rear, cosine, 1.0))
    return np.concatenate([front, -front - rear, rear, -(sine * (2.0 / (1.0 + cosine)))[None]])


def bends(vertices_m: Array) -> Bends:
    """Returns how a rod with vertices ``(3, ..., n_vertices)``, m, is bent."""
    edge = vertices_m[..., 1:] - vertices_m[..., :-1]
    per_length = 1.0 / np.sqrt((edge * edge).sum(axis=0))
    tangent = edge * per_length
    t0, t1 = tangent[..., :-1], tangent[..., 1:]
    across = cross(t0, t1)
    sine, cosine = np.sqrt((across * across).sum(axis=0)), (t0 * t1).sum(axis=0)
    per_cosine = 2.0 / (1.0 + cosine)
    b = across * (per_cosine * (sine > STRAIGHT) / np.maximum(sine, STRAIGHT))
    return Bends(b, sine, cosine, per_length)


def add_held_coordinate(spec: mujoco.MjSpec) -> None:
    """Adds, once, the coordinate that every row includes: to every model, so that all have as many."""
    if spec.body(HELD) is None:
        held = add_holder(spec, HELD, HELD_MASS_KG, HELD_MASS_KG)
        held.gravcomp = 1.0
        held.add_joint(name=HELD, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1.0, 0.0, 0.0])


def add_holder(spec: mujoco.MjSpec, name: str, mass_kg: float, inertia_kg_m2: float) -> mujoco.MjsBody:
    """Adds a body of the world, a point mass with the same small inertia about every axis."""
    return spec.worldbody.add_body(
        name=name,
        mass=mass_kg,
        ipos=[0.0, 0.0, 0.0],
        iquat=[1.0, 0.0, 0.0, 0.0],
        inertia=[inertia_kg_m2] * 3,
        explicitinertial=True,
    )


def add_dampers(
    spec: mujoco.MjSpec,
    rod: str,
    vertices_m: Array,
    bodies: list[str],
    strands: Strands,
    shares: Array,
    *,
    clamped: bool,
) -> None:
    """Adds a fixed tendon for every inner vertex of a rod, with the coefficients of the posture at rest.

    The vertices are ``(n_vertices, 3)``, the body of a fixed one is "world", the shares are those of the stiffness in
    bending, ``(n_vertices - 2,)``, and the first edge of a clamped rod has no twist hinge.
    """
    lengths = np.linalg.norm(np.diff(vertices_m, axis=0), axis=1)
    damping, rows = _coefficients(lengths, strands) * shares, damper_rows(bends(vertices_m.T))
    clamped_hinge = twist_name(rod, 0, len(lengths)) if clamped else ""
    for vertex in range(1, len(bodies) - 1):
        joints = [f"{body}_{axis}" for body in bodies[vertex - 1 : vertex + 2] for axis in "xyz"]
        joints.append(twist_name(rod, damped_edge(vertex), len(lengths)))
        tendon = spec.add_tendon(name=damper_name(rod, vertex), damping=[damping[vertex - 1], 0.0, 0.0])
        for joint, coefficient in zip(joints, rows[:, vertex - 1].tolist(), strict=True):
            if not joint.startswith("world_") and joint != clamped_hinge:
                tendon.wrap_joint(joint, coefficient)


def add_tie(spec: mujoco.MjSpec, pin: str, point: str, tie: Tie) -> None:
    """Ties two vertices on slides, at one place, by a spring and a dashpot along each of the world's axes."""
    add_held_coordinate(spec)
    for axis in "xyz":
        stiffness, damping = [tie.stiffness_N_per_m, 0.0, 0.0], [tie.damping_Ns_per_m, 0.0, 0.0]
        tendon = spec.add_tendon(name=f"{_TIE}{point}_{axis}", stiffness=stiffness, damping=damping)
        tendon.wrap_joint(f"{pin}_{axis}", -1.0)
        tendon.wrap_joint(f"{point}_{axis}", 1.0)


def tied_bodies(model: mujoco.MjModel) -> NDArray[np.intp]:
    """Returns the bodies of a pin and of a strand's vertex for every tie of a compiled model, ``(n_ties, 2)``."""
    return model.jnt_bodyid[_ties(model)[1][:, ::3]].T.astype(np.intp)


def _ties(model: mujoco.MjModel) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The tendons of ties, ``(3 n_ties,)``, and the slides of pin and vertex that each holds together, ``(2, ..)``."""
    found = [i for i in range(model.ntendon) if model.tendon(i).name.startswith(_TIE)]
    tendons = np.array(found, dtype=np.intp)
    return tendons, model.wrap_objid[model.tendon_adr[tendons] + np.array([[0], [1]])].astype(np.intp)


def tendons_to_rows(spec: mujoco.MjSpec) -> None:
    """Replaces the dampers of rods and the ties of pins by constraint rows, to be completed for the compiled model.

    `MaterialDamping` and `Ties` do that.
    """
    tendons = [tendon for tendon in spec.tendons if _DAMPER in tendon.name or tendon.name.startswith(_TIE)]
    if not tendons:
        return
    add_row(spec, mujoco.mjtEq.mjEQ_JOINT, mujoco.mjtObj.mjOBJ_JOINT, HELD, HELD)
    step_s = spec.option.timestep
    for tendon in tendons:
        stiffness, damping = float(tendon.stiffness[0]), float(tendon.damping[0])
        tendon.stiffness = tendon.damping = [0.0, 0.0, 0.0]
        tendon.wrap_joint(HELD, HELD_LEVER)
        # Of stiffness and damping over inertance, times the impedance as the engine has it; it wants a stiffness.
        whole, scale = damping + step_s * stiffness, IMPEDANCE / (INERTANCE * step_s)
        solref = [-max(stiffness / whole * scale, 1e-12), -damping / whole * scale]
        limits = {"solref": solref, "solimp": [IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0]}
        add_row(spec, mujoco.mjtEq.mjEQ_TENDON, mujoco.mjtObj.mjOBJ_TENDON, tendon.name, tendon.name, **limits)


def _weigh_rows(model: mujoco.MjModel, tendons: NDArray[np.intp], damping: Array | float) -> None:
    """Gives the rows of tendons in a compiled model their damping; of ties it is that of the spring over a step too."""
    model.tendon_invweight0[tendons] = IMPEDANCE / (1.0 - IMPEDANCE) / (INERTANCE * damping * model.opt.timestep)
    model.dof_invweight0[model.joint(HELD).dofadr] = HELD_INVERSE_KG


def add_row(
    spec: mujoco.MjSpec, kind: mujoco.mjtEq, of: mujoco.mjtObj, name: str, *between: str, **options: Sequence[float]
) -> None:
    """Adds an equality constraint of one or two things of the spec, with no data unless options give some."""
    names = dict(zip(("name1", "name2"), between, strict=False))
    spec.add_equality(**{"name": name, "type": kind, "objtype": of, "data": [0.0] * 12, **names, **options})


def twist_joints(model: mujoco.MjModel) -> NDArray[np.intp]:
    """Returns the twist hinges of a compiled net of rods, ``(n_rods, n_edges)``."""
    n_edges = int(model.flex_edgenum[0])
    names = [[twist_name(f"strand_{rod}", edge, n_edges) for edge in range(n_edges)] for rod in range(model.nflex)]
    return np.array([[model.joint(name).id for name in of_rod] for of_rod in names], dtype=np.intp)


def rod_stiffness(model: mujoco.MjModel, strands: Strands) -> tuple[Array, Array]:
    """Returns ``E I / (l + l')`` and ``G J / (l + l')`` at inner vertices, N m, ``(n_rods, n_edges - 1)``."""
    lengths = model.flexedge_length0.reshape(model.nflex, -1)
    per_length = pi * strands.radius_m**4 / (lengths[:, :-1] + lengths[:, 1:])
    material, (bending, twist) = strands.of_segment(0), rod_shares(model)
    return (
        material.one_number("young_modulus_Pa") * per_length / 4 * bending,
        material.one_number("shear_modulus_Pa") * per_length / 2 * twist,
    )


class RodVertices:
    """Where the vertices of a compiled net of rods are, each on three slides along the world's axes.

    Attributes:
        dof: The engine's dofs of the vertices, ``(3, n_rods, n_vertices)``.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        """Finds the slides of rods that have as many edges each."""
        bodies = model.flex_vertbodyid.reshape(model.nflex, -1)
        slide = model.body_jntadr[bodies] + np.arange(3)[:, None, None]
        # numpy would convert other integers at every step.
        self._slide, self.dof = model.jnt_qposadr[slide].astype(np.intp), model.jnt_dofadr[slide].astype(np.intp)
        self._place = model.body_pos[bodies].transpose(2, 0, 1).copy()

    def at(self, qpos: Array) -> Array:
        """Returns the vertices of a posture, ``(..., nq)``: positions, m, ``(..., 3, n_rods, n_vertices)``."""
        return self._place + qpos.take(self._slide, axis=-1)


class Ties:
    """The ties between pins and strands of a worm compiled with `tendons_to_rows`."""

    def __init__(self, model: mujoco.MjModel, tie: Tie) -> None:
        """Finds the rows and completes them."""
        self._tie = tie
        tendons, slides = _ties(model)
        self._qpos, self._dof = model.jnt_qposadr[slides].astype(np.intp), model.jnt_dofadr[slides].astype(np.intp)
        _weigh_rows(model, tendons, tie.damping_Ns_per_m + model.opt.timestep * tie.stiffness_N_per_m)

    def energy_J(self, qpos: Array) -> float:
        """What the springs store in a posture, ``(nq,)``, J."""
        apart = qpos[self._qpos[1]] - qpos[self._qpos[0]]
        return 0.5 * self._tie.stiffness_N_per_m * float(apart @ apart)

    def power_W(self, qpos: Array, qvel: Array) -> tuple[float, float]:
        """What springs and dashpots take at positions, ``(nq,)``, and velocities, ``(nv,)``, W."""
        apart, rate = qpos[self._qpos[1]] - qpos[self._qpos[0]], qvel[self._dof[1]] - qvel[self._dof[0]]
        stiffness, damping = self._tie
        return stiffness * float(apart @ rate), damping * float(rate @ rate)


class MaterialDamping:
    """Renews the rows of one worm, compiled with `tendons_to_rows`, for its posture before every step.

    They live in the compiled model, which no other worm may use. The posture alone decides, so a run continues and a
    batch computes to the same bits.

    Attributes:
        bent: How the rods are bent in that posture, ``(..., n_rods, ...)``.
    """

    def __init__(self, model: mujoco.MjModel, strands: Strands) -> None:
        """Finds the rows and gives them the damping of a material with a damping time."""
        n_strands, n_edges = model.nflex, int(model.flex_edgenum[0])
        names = [f"strand_{strand}" for strand in range(n_strands)]
        lengths = model.flexedge_length0.reshape(n_strands, n_edges)
        self._damping = _coefficients(lengths, strands.of_segment(0)) * rod_shares(model)[0]
        tendons = np.array([[model.tendon(damper_name(name, v)).id for v in range(1, n_edges)] for name in names])
        _weigh_rows(model, tendons, self._damping)
        # The dampers' coefficients lie one after another, each damper's with that of the held dof at its end.
        first, last = int(model.tendon_adr[tendons[0, 0]]), int(model.tendon_adr[tendons[-1, -1]]) + _PER_ROW + 1
        shape = (*tendons.shape, _PER_ROW + 1)
        assert np.array_equal(model.tendon_adr[tendons].ravel(), np.arange(first, last, _PER_ROW + 1))
        self._row = model.wrap_prm[first:last].reshape(shape)[..., :_PER_ROW]
        dofs = model.jnt_dofadr[model.wrap_objid[first:last]].reshape(shape)[..., :_PER_ROW]
        # numpy would convert other integers at every step.
        self._dof = dofs.astype(np.intp)
        self._vertices = RodVertices(model)

    def renew(self, qpos: Array) -> None:
        """Sets the rows for a posture, ``(nq,)``."""
        self.bent = bends(self._vertices.at(qpos))
        self._row[:] = damper_rows(self.bent).transpose(1, 2, 0)

    def loss_W(self, qvel: Array) -> float:
        """Power that the rows take at velocities, ``(nv,)``, W."""
        rate = (self._row * qvel.take(self._dof)).sum(axis=-1)
        return float((self._damping * rate * rate).sum())
