"""Tendons between the crossings, the same for every formulation: axial springs, ring actuators, crossings' friction.

Two strands that cross at the angle a span rhombi of side s with an axial diagonal ``d = 2 s cos(a/2)``, which lengthens
by half the hoop diagonal ``h = 2 s sin(a/2)`` a radian. With one rhombus for every crossing, a torque T at the
crossings does the work of a force ``2 T / h`` in the axial diagonals, and a torque c per angular velocity that of ``4 c
/ h^2`` per velocity. Both are set at rest: a Coulomb torque is exact there and proportional to h elsewhere.
"""

from __future__ import annotations

import mujoco
import numpy as np

from annelid.arena.geoms import HIDDEN_GROUP
from annelid.body.actuators import ActuatorKind
from annelid.body.mesh import Joints, Springs
from annelid.morphology import Indices, MeshGeometry

SPRING_RGBA = (0.75, 0.15, 0.1, 1.0)
PIN_RGBA = (0.25, 0.25, 0.28, 1.0)
RING_RGBA = (0.85, 0.1, 0.1, 1.0)
STICTION_IMPEDANCE = [0.9999, 0.9999, 0.001, 0.5, 2.0]
"""The engine's greatest: a diagonal that sticks creeps by a ten-thousandth of what it would do freely."""


def crossing_site(crossing: int) -> str:
    """Name of the site (and body) of a crossing."""
    return f"crossing_{crossing}"


def mark_crossing(pin: mujoco.MjsBody, name: str, radius_m: float, mass_kg: float) -> None:
    """Adds the sphere by which a crossing is drawn, and its site, at the origin of a body."""
    ball = mujoco.mjtGeom.mjGEOM_SPHERE
    size = [radius_m, 0.0, 0.0]
    pin.add_geom(name=name, type=ball, size=size, mass=mass_kg, contype=0, conaffinity=0, rgba=PIN_RGBA)
    pin.add_site(name=name, size=[0.002, 0.002, 0.002], group=HIDDEN_GROUP)


def ring_names(n_segments: int, rings: ActuatorKind) -> list[str]:
    """Names of the ring actuators: segment by segment, left before right.

    Args:
        n_segments: Segments of the worm.
        rings: Its ring actuators.
    """
    sides = ("",) if rings.layout == "whole" else ("_left", "_right")
    return [f"ring_{segment}{side}" for segment in range(n_segments) for side in sides]


def add_springs(spec: mujoco.MjSpec, geometry: MeshGeometry, springs: Springs) -> None:
    """Adds one spatial tendon a spring: bilateral, or slack below its rest length."""
    n, middle_x = geometry.n_segments, geometry.crossings_m[geometry.springs, 0].mean(axis=1)
    rates = geometry.along(springs.of_each("stiffness_N_per_m", n), middle_x).tolist()
    lengths = geometry.spring_length_m
    if springs.rest_length_m is not None:
        lengths = geometry.along(springs.of_each("rest_length_m", n), middle_x)
    for index, (ends, rate, rest) in enumerate(zip(geometry.springs.tolist(), rates, lengths.tolist(), strict=True)):
        tendon = spec.add_tendon(
            name=f"spring_{index}",
            stiffness=[rate, 0.0, 0.0],
            springlength=[0.0 if springs.tension_only else rest, rest],
            width=0.0015,
            rgba=SPRING_RGBA,
        )
        for crossing in ends:
            tendon.wrap_site(crossing_site(crossing))
        add_length_sensor(spec, f"spring_{index}")


def stretch_sensors(geometry: MeshGeometry, springs: Springs) -> Indices:
    """Returns the springs with a sensor, ``(n_segments, n_sensors)``: all round a ring, or the left and the right.

    Args:
        geometry: The mesh.
        springs: Its springs.
    """
    every = geometry.sensor_springs
    if springs.sensors == "all":
        return every
    middle_y = geometry.crossings_m[geometry.springs[every], 1].mean(axis=-1)
    # Segment 1 leads towards -x, so the worm's left is -y.
    sides = np.stack([middle_y.argmin(axis=1), middle_y.argmax(axis=1)], axis=-1)
    return np.take_along_axis(every, sides, axis=1)


def add_ring_actuators(spec: mujoco.MjSpec, geometry: MeshGeometry, rings: ActuatorKind) -> None:
    """Adds the ring tendons with a muscle or a servo on each.

    Half-rings run over half of the ring's crossings each and share its top and bottom crossing; their
    operating range is half that of the whole ring, and their force that of the whole ring.
    """
    n = geometry.n_segments
    names = iter(ring_names(n, rings))
    for segment, (span, force) in enumerate(zip(rings.length_ranges(n), rings.forces(n), strict=True)):
        paths = _ring_paths(geometry, segment, rings)
        for path in paths:
            name = next(names)
            tendon = spec.add_tendon(name=name, width=0.003, rgba=RING_RGBA)
            for crossing in path:
                tendon.wrap_site(crossing_site(crossing))
            rings.add(spec, name, [bound / len(paths) for bound in span], force)
            add_length_sensor(spec, name)
            sensor, actuator = mujoco.mjtSensor.mjSENS_ACTUATORFRC, mujoco.mjtObj.mjOBJ_ACTUATOR
            spec.add_sensor(name=f"{name}_force", type=sensor, objtype=actuator, objname=name)


def _ring_paths(geometry: MeshGeometry, segment: int, rings: ActuatorKind) -> list[list[int]]:
    """Crossings that each actuator of a segment runs through: one closed path, or a left and a right half."""
    ring = geometry.rings[segment]
    if rings.layout == "whole":
        return [[*ring.tolist(), int(ring[0])]]
    top = int(np.argmax(geometry.crossings_m[ring, 2]))
    half, closed = len(ring) // 2, np.roll(ring, -top).tolist()
    halves = closed[: half + 1], [*closed[half:], closed[0]]
    # Segment 1 leads towards -x, so the worm's left is -y.
    return sorted(halves, key=lambda path: geometry.crossings_m[path, 1].mean())


def add_length_sensor(spec: mujoco.MjSpec, tendon: str, name: str | None = None) -> None:
    """Adds the engine's own sensor of a tendon's length, for users of the written MJCF."""
    sensor = mujoco.mjtSensor.mjSENS_TENDONPOS
    spec.add_sensor(name=name or f"{tendon}_length", type=sensor, objtype=mujoco.mjtObj.mjOBJ_TENDON, objname=tendon)


def add_joint_friction(spec: mujoco.MjSpec, geometry: MeshGeometry, joints: Joints) -> None:
    """Adds one tendon along the axial diagonal of every rhombus, or nothing if there is no friction of crossings."""
    dry, viscous = joints.dry_friction_Nm, joints.viscous_friction_Nms_per_rad
    if not (dry or viscous):
        return
    for index, (front, left, rear, right) in enumerate(geometry.rhombi.tolist()):
        lever = float(np.linalg.norm(geometry.crossings_m[left] - geometry.crossings_m[right])) / 2
        sites = crossing_site(front), crossing_site(rear)
        add_diagonal_friction(spec, f"diagonal_{index}", sites, dry / lever, viscous / lever**2)


def add_diagonal_friction(
    spec: mujoco.MjSpec, name: str, sites: tuple[str, str], dry_N: float, viscous_Ns_per_m: float
) -> None:
    """Adds a tendon between two sites that resists any change of its length, by a Coulomb force and per velocity."""
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
