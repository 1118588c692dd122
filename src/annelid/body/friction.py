"""Dry and viscous friction of the crossings, as resistance of the rhombi's diagonals.

Two strands that cross at the angle a span rhombi of side s, whose axial diagonal is ``d = 2 s cos(a/2)`` and whose
hoop diagonal is ``h = 2 s sin(a/2)``. A change of the angle lengthens the axial diagonal by ``h/2`` a radian, and there
is one rhombus for every crossing, so a torque T at the crossings does the work of a force ``2 T / h`` in the diagonals,
and a torque c per angular velocity that of ``4 c / h^2`` per velocity. Force and damping of a diagonal are constant and
set at rest: a Coulomb torque so given is exact at rest and proportional to h elsewhere, two thirds at a ring
contracted to two thirds.
"""

from __future__ import annotations

import mujoco
import numpy as np

from annelid.body.actuation import crossing_site
from annelid.body.worm import Joints
from annelid.morphology import MeshGeometry

STICTION_IMPEDANCE = [0.9999, 0.9999, 0.001, 0.5, 2.0]
"""The engine's greatest: a diagonal that sticks creeps by a ten-thousandth of what it would do freely."""


def add_joint_friction(spec: mujoco.MjSpec, geometry: MeshGeometry, joints: Joints) -> None:
    """Adds one tendon along the axial diagonal of every rhombus, or nothing if there is no friction.

    Args:
        spec: A spec with the crossings' sites and its time step set.
        geometry: The mesh at rest.
        joints: Friction of a crossing.
    """
    if not (joints.dry_friction_Nm or joints.viscous_friction_Nms_per_rad):
        return
    for index, (front, left, rear, right) in enumerate(geometry.rhombi.tolist()):
        lever = float(np.linalg.norm(geometry.crossings_m[left] - geometry.crossings_m[right])) / 2
        add_diagonal_friction(
            spec,
            diagonal_name(index),
            (crossing_site(front), crossing_site(rear)),
            joints.dry_friction_Nm / lever,
            joints.viscous_friction_Nms_per_rad / lever**2,
        )


def diagonal_name(rhombus: int) -> str:
    """Name of the tendon along a rhombus's axial diagonal."""
    return f"diagonal_{rhombus}"


def add_diagonal_friction(
    spec: mujoco.MjSpec, name: str, sites: tuple[str, str], dry_N: float, viscous_Ns_per_m: float
) -> None:
    """Adds a tendon between two sites that resists any change of its length.

    Args:
        spec: A spec with the sites and its time step set.
        name: Name of the tendon.
        sites: Names of its two ends.
        dry_N: Coulomb force.
        viscous_Ns_per_m: Force per velocity.
    """
    tendon = spec.add_tendon(
        name=name,
        width=0.0005,
        group=5,
        frictionloss=dry_N,
        damping=[viscous_Ns_per_m, 0.0, 0.0],
        # Velocity is stopped within one step: the fastest that a step resolves.
        solref_friction=[-1e-12, -1.0 / spec.option.timestep],
        solimp_friction=STICTION_IMPEDANCE,
    )
    for site in sites:
        tendon.wrap_site(site)
