"""Axial springs and ring actuators: tendons between the crossings, the same for every formulation."""

from __future__ import annotations

import mujoco
import numpy as np

from annelid.config import Rings, ServoRings, Springs
from annelid.morphology import Array, Indices, MeshGeometry

SPRING_RGBA = (0.75, 0.15, 0.1, 1.0)
RING_RGBA = (0.85, 0.1, 0.1, 1.0)
ACTIVATION_TIMES_S = (0.01, 0.04)
"""MuJoCo's time constants of muscle activation and deactivation."""


def crossing_site(crossing: int) -> str:
    """Name of the site (and body) of a crossing."""
    return f"crossing_{crossing}"


def ring_names(n_segments: int, rings: Rings | ServoRings) -> list[str]:
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


def add_ring_actuators(spec: mujoco.MjSpec, geometry: MeshGeometry, rings: Rings | ServoRings) -> None:
    """Adds the ring tendons with a muscle or a servo on each.

    Half-rings run over half of the ring's crossings each and share its top and bottom crossing; their
    operating range is half that of the whole ring, and their force that of the whole ring.
    """
    n = geometry.n_segments
    ranges = rings.length_ranges(n)
    forces = rings.force_limits(n) if isinstance(rings, ServoRings) else rings.peak_forces(n)
    names = iter(ring_names(n, rings))
    for segment in range(n):
        paths = ring_paths(geometry, segment, rings)
        span = [bound / len(paths) for bound in ranges[segment]]
        for path in paths:
            name = next(names)
            _add_ring_tendon(spec, name, path)
            if isinstance(rings, ServoRings):
                _add_servo(spec, name, span, forces[segment], rings)
            else:
                _add_muscle(spec, name, span, forces[segment], rings)
            _add_length_sensor(spec, name)
            spec.add_sensor(
                name=f"{name}_force",
                type=mujoco.mjtSensor.mjSENS_ACTUATORFRC,
                objtype=mujoco.mjtObj.mjOBJ_ACTUATOR,
                objname=name,
            )


def ring_paths(geometry: MeshGeometry, segment: int, rings: Rings | ServoRings) -> list[list[int]]:
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


def _add_muscle(spec: mujoco.MjSpec, name: str, span: list[float], peak_force_N: float, rings: Rings) -> None:
    actuator = spec.add_actuator(
        name=name,
        target=name,
        trntype=mujoco.mjtTrn.mjTRN_TENDON,
        lengthrange=span,
        ctrllimited=True,
        ctrlrange=[0.0, 1.0],
    )
    actuator.set_to_muscle(
        timeconst=ACTIVATION_TIMES_S,
        tausmooth=0.0,
        range=[0.75, 1.05],
        force=peak_force_N,
        lmin=rings.minimum_length,
        lmax=rings.maximum_length,
        vmax=rings.maximum_velocity,
        fpmax=rings.passive_peak,
        fvmax=rings.lengthening_peak,
    )
    if not rings.activation_dynamics:
        actuator.dyntype = mujoco.mjtDyn.mjDYN_NONE


def _add_servo(spec: mujoco.MjSpec, name: str, span: list[float], force_limit_N: float, rings: ServoRings) -> None:
    """Adds a cable whose slack length is the engine's state: its rate is the control, `winding_speed`."""
    stiffness, speed = rings.stiffness_N_per_m, rings.speed_limit_m_per_s
    spec.add_actuator(
        name=name,
        target=name,
        trntype=mujoco.mjtTrn.mjTRN_TENDON,
        dyntype=mujoco.mjtDyn.mjDYN_INTEGRATOR,
        gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        biastype=mujoco.mjtBias.mjBIAS_AFFINE,
        gainprm=[stiffness, *[0.0] * 9],
        biasprm=[0.0, -stiffness, -rings.damping_Ns_per_m, *[0.0] * 7],
        lengthrange=span,
        ctrllimited=True,
        ctrlrange=[-speed, speed],
        actlimited=True,
        actrange=span,
        forcelimited=True,
        forcerange=[-force_limit_N, 0.0],
    )


def winding_speed(
    activation: Array,
    slack_m: Array,
    length_m: Array,
    range_m: Array,
    force_limit_N: Array,
    rings: ServoRings,
    time_s: float,
) -> Array:
    """Rate at which servos change the slack length of their cables, m/s: negative while they wind.

    Towards the commanded length, but never so short that the tension at rest would exceed the force limit: a stalled
    servo does not wind on, gives way to what pulls harder, and lets go at once when it is told to.

    Args:
        activation: In [0, 1], shape ``(.., n_servos)``; commands a slack length between the ends of the range.
        slack_m: Present slack lengths, m, same shape.
        length_m: Present lengths of the cables' paths, m, same shape.
        range_m: Shortest and longest slack length, m, ``(n_servos, 2)``.
        force_limit_N: Tension at which a servo stalls, N, ``(n_servos,)``.
        rings: Speed and stiffness.
        time_s: For how long the rate is held, s: a cable does not overshoot the length that it is wound to.
    """
    shortest, longest = range_m[:, 0], range_m[:, 1]
    commanded = longest + activation * (shortest - longest)
    stalled = np.minimum(length_m - force_limit_N / rings.stiffness_N_per_m, longest)
    rate = (np.maximum(commanded, stalled) - slack_m) / time_s
    speed = rings.speed_limit_m_per_s
    return np.minimum(np.maximum(rate, -speed), speed)


def _add_length_sensor(spec: mujoco.MjSpec, tendon: str) -> None:
    """Adds the engine's own sensor of a tendon's length, for users of the written MJCF."""
    spec.add_sensor(
        name=f"{tendon}_length",
        type=mujoco.mjtSensor.mjSENS_TENDONPOS,
        objtype=mujoco.mjtObj.mjOBJ_TENDON,
        objname=tendon,
    )
