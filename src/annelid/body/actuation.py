"""Axial springs and ring actuators: tendons between the crossings, the same for every formulation."""

from __future__ import annotations

import mujoco
import numpy as np

from annelid.body.actuators import ActuatorKind
from annelid.body.worm import Springs
from annelid.morphology import Indices, MeshGeometry

SPRING_RGBA = (0.75, 0.15, 0.1, 1.0)
RING_RGBA = (0.85, 0.1, 0.1, 1.0)


def crossing_site(crossing: int) -> str:
    """Name of the site (and body) of a crossing."""
    return f"crossing_{crossing}"


def ring_names(n_segments: int, rings: ActuatorKind) -> list[str]:
    """Names of the ring actuators: segment by segment, left before right."""
    if rings.layout == "whole":
        return [f"ring_{segment}" for segment in range(n_segments)]
    return [f"ring_{segment}_{side}" for segment in range(n_segments) for side in ("left", "right")]


def add_springs(spec: mujoco.MjSpec, geometry: MeshGeometry, springs: Springs) -> None:
    """Adds one spatial tendon a spring: bilateral, or slack below its rest length."""
    for index, (front, rear) in enumerate(geometry.springs):
        rest = springs.rest_length_m or float(geometry.spring_length_m[index])
        tendon = spec.add_tendon(
            name=f"spring_{index}",
            stiffness=[springs.stiffness_N_per_m, 0.0, 0.0],
            springlength=[0.0 if springs.tension_only else rest, rest],
            width=0.0015,
            rgba=SPRING_RGBA,
        )
        tendon.wrap_site(crossing_site(int(front)))
        tendon.wrap_site(crossing_site(int(rear)))
        _add_length_sensor(spec, f"spring_{index}")


def stretch_sensors(geometry: MeshGeometry, springs: Springs) -> Indices:
    """Returns the springs with a sensor, ``(n_segments, n_sensors)``: all round a ring, or the left and the right."""
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
    ranges = rings.length_ranges(n)
    forces = rings.forces(n)
    names = iter(ring_names(n, rings))
    for segment in range(n):
        paths = ring_paths(geometry, segment, rings)
        span = [bound / len(paths) for bound in ranges[segment]]
        for path in paths:
            name = next(names)
            _add_ring_tendon(spec, name, path)
            rings.add(spec, name, span, forces[segment])
            _add_length_sensor(spec, name)
            spec.add_sensor(
                name=f"{name}_force",
                type=mujoco.mjtSensor.mjSENS_ACTUATORFRC,
                objtype=mujoco.mjtObj.mjOBJ_ACTUATOR,
                objname=name,
            )


def ring_paths(geometry: MeshGeometry, segment: int, rings: ActuatorKind) -> list[list[int]]:
    """Crossings that each actuator of a segment runs through: one closed path, or a left and a right half."""
    ring: Indices = geometry.rings[segment]
    if rings.layout == "whole":
        return [[*ring.tolist(), int(ring[0])]]
    corners = geometry.crossings_m[ring]
    top = int(np.argmax(corners[:, 2]))
    half = len(ring) // 2
    closed = np.roll(ring, -top)
    first = closed[: half + 1].tolist()
    second = [*closed[half:].tolist(), int(closed[0])]
    # Segment 1 leads towards -x, so the worm's left is -y.
    first_is_left = geometry.crossings_m[first, 1].mean() < geometry.crossings_m[second, 1].mean()
    return [first, second] if first_is_left else [second, first]


def _add_ring_tendon(spec: mujoco.MjSpec, name: str, path: list[int]) -> None:
    tendon = spec.add_tendon(name=name, width=0.003, rgba=RING_RGBA)
    for crossing in path:
        tendon.wrap_site(crossing_site(crossing))


def _add_length_sensor(spec: mujoco.MjSpec, tendon: str) -> None:
    """Adds the engine's own sensor of a tendon's length, for users of the written MJCF."""
    spec.add_sensor(
        name=f"{tendon}_length",
        type=mujoco.mjtSensor.mjSENS_TENDONPOS,
        objtype=mujoco.mjtObj.mjOBJ_TENDON,
        objname=tendon,
    )
