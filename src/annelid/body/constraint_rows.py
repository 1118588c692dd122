"""Springs and dashpots that the engine solves at the end of a step with all that they couple: rows of its constraints.

A row has coefficients, one for each coordinate that it resists the motion of, which a plant sets anew from the current
posture before every step: the strains of rods (`annelid.body.formulations.rods.strains`), and the ties between separate
pins and their strands. The engine scales a row by A, the ratio of the row's inverse inertia without the forces of the
step to that with them: a row's force is ``-A (I a + c v + k r)``, with the wanted damping c and stiffness k, and a
small inertance I. A depends on step, posture and the world's axes, and would be 1 to 80. So every row also includes one
dof that is fixed and so light that it alone decides about A, which then is 1.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from annelid.body.formulations import Tie
from annelid.morphology import Array

HELD = "row_reference"
HELD_MASS_KG = 1e-9
HELD_LEVER = 1e3
"""Coefficient of the held dof in every row: its share of a row's inverse inertia is 1e15, of the others 1e9 at most."""
HELD_INVERSE_KG = 1e-16
"""The engine fixes a dof by a force in proportion to the inertia that it believes it to have."""
INERTANCE = 1e-3
"""Of a row, as a share of its damping times the step, and of its stiffness times the square: nothing to be seen."""
IMPEDANCE = 0.01
_ROW, _TIE = "row_", "row_tie_"
LEAST_INERTIA_KG_M2 = 2e-15
"""Twice the least that the engine takes."""


def add_held_coordinate(spec: mujoco.MjSpec, name: str = HELD) -> None:
    """Adds, once, the coordinate that every row includes."""
    if spec.body(name) is None:
        held = add_holder(spec, name, HELD_MASS_KG, HELD_MASS_KG)
        held.gravcomp = 1.0
        held.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1.0, 0.0, 0.0])


def add_holder(spec: mujoco.MjSpec, name: str, mass_kg: float, inertia_kg_m2: float) -> mujoco.MjsBody:
    """Adds a body of the world, a point mass with the same small inertia about every axis.

    The engine refuses less than `LEAST_INERTIA_KG_M2`. More than its own changes nothing for a point on slides, which
    never turns, and little for the twist of an edge (`annelid.body.formulations.rods.net.MOST_RAISED`).
    """
    return spec.worldbody.add_body(
        name=name,
        mass=mass_kg,
        ipos=[0.0, 0.0, 0.0],
        iquat=[1.0, 0.0, 0.0, 0.0],
        inertia=[max(inertia_kg_m2, LEAST_INERTIA_KG_M2)] * 3,
        explicitinertial=True,
    )


def row_tendon(spec: mujoco.MjSpec, name: str, stiffness: float, damping: float) -> mujoco.MjsTendon:
    """Adds a tendon of no coordinates yet, which `tendons_to_rows` makes a row of that name."""
    add_held_coordinate(spec)
    return spec.add_tendon(name=f"{_ROW}{name}", stiffness=[stiffness, 0.0, 0.0], damping=[damping, 0.0, 0.0])


def row_name(name: str) -> str:
    """Name in the model of what `row_tendon` has added: of a tendon, and of the equality that is its row."""
    return f"{_ROW}{name}"


def add_tie(spec: mujoco.MjSpec, pin: str, point: str, tie: Tie) -> None:
    """Ties two vertices on slides, at one place, by a spring and a dashpot along each of the world's axes."""
    for axis in "xyz":
        tendon = row_tendon(spec, f"{_TIE.removeprefix(_ROW)}{point}_{axis}", *tie)
        tendon.wrap_joint(f"{pin}_{axis}", -1.0)
        tendon.wrap_joint(f"{point}_{axis}", 1.0)


def _ties(model: mujoco.MjModel) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The tendons of ties, ``(3 n_ties,)``, and the slides of pin and vertex that each holds together, ``(2, ..)``."""
    found = [i for i in range(model.ntendon) if model.tendon(i).name.startswith(_TIE)]
    tendons = np.array(found, dtype=np.intp)
    return tendons, model.wrap_objid[model.tendon_adr[tendons] + np.array([[0], [1]])].astype(np.intp)


def tendons_to_rows(spec: mujoco.MjSpec) -> None:
    """Makes constraint rows of the tendons of `row_tendon`, for `complete_rows` to complete in the compiled model."""
    tendons = [tendon for tendon in spec.tendons if tendon.name.startswith(_ROW)]
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


def complete_rows(model: mujoco.MjModel, tendons: NDArray[np.intp], stiff: Array | float) -> None:
    """Gives the rows of tendons in a compiled model their strength: damping, and stiffness times the engine's step."""
    model.tendon_invweight0[tendons] = IMPEDANCE / (1.0 - IMPEDANCE) / (INERTANCE * stiff * model.opt.timestep)
    model.dof_invweight0[model.joint(HELD).dofadr] = HELD_INVERSE_KG


def add_row(
    spec: mujoco.MjSpec, kind: mujoco.mjtEq, of: mujoco.mjtObj, name: str, *between: str, **options: Sequence[float]
) -> None:
    """Adds an equality constraint of one or two things of the spec, with no data unless options give some."""
    names = dict(zip(("name1", "name2"), between, strict=False))
    spec.add_equality(**{"name": name, "type": kind, "objtype": of, "data": [0.0] * 12, **names, **options})


class Ties:
    """The ties between pins and strands of a worm compiled with `tendons_to_rows`."""

    def __init__(self, model: mujoco.MjModel, tie: Tie) -> None:
        """Finds the rows and completes them."""
        self._tie = tie
        tendons, slides = _ties(model)
        self._qpos, self._dof = model.jnt_qposadr[slides].astype(np.intp), model.jnt_dofadr[slides].astype(np.intp)
        complete_rows(model, tendons, tie.damping_Ns_per_m + model.opt.timestep * tie.stiffness_N_per_m)

    def energy_J(self, qpos: Array) -> float:
        """What the springs store in a posture, ``(nq,)``, J."""
        apart = qpos[self._qpos[1]] - qpos[self._qpos[0]]
        return 0.5 * self._tie.stiffness_N_per_m * float(apart @ apart)

    def power_W(self, qpos: Array, qvel: Array) -> tuple[float, float]:
        """What springs and dashpots take at positions, ``(nq,)``, and velocities, ``(nv,)``, W."""
        apart, rate = qpos[self._qpos[1]] - qpos[self._qpos[0]], qvel[self._dof[1]] - qvel[self._dof[0]]
        stiffness, damping = self._tie
        return stiffness * float(apart @ rate), damping * float(rate @ rate)
