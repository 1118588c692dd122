"""Axial springs and ring muscles: tendons between the crossings, the same for every formulation."""

from __future__ import annotations

import mujoco
import numpy as np

from annelid.config import Rings, Springs
from annelid.morphology import Indices, MeshGeometry

SPRING_RGBA = (0.75, 0.15, 0.1, 1.0)
RING_RGBA = (0.85, 0.1, 0.1, 1.0)
ACTIVATION_TIMES_S = (0.01, 0.04)
"""MuJoCo's time constants of muscle activation and deactivation."""


def crossing_site(crossing: int) -> str:
    """Name of the site (and body) of a crossing."""
    return f"crossing_{crossing}"


def ring_names(n_segments: int, rings: Rings) -> list[str]:
    """Names of the ring muscles: segment by segment, left before right."""
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


def add_ring_muscles(spec: mujoco.MjSpec, geometry: MeshGeometry, rings: Rings) -> None:
    """Adds the ring tendons with MuJoCo's force-length-velocity muscle on each.

    Half-rings run over half of the ring's crossings each and share its top and bottom crossing; their
    operating range is half that of the whole ring.
    """
    ranges = rings.length_ranges(geometry.n_segments)
    names = iter(ring_names(geometry.n_segments, rings))
    for segment in range(geometry.n_segments):
        paths = ring_paths(geometry, segment, rings)
        share = 1.0 / len(paths)
        for path in paths:
            _add_muscle(spec, next(names), path, [share * bound for bound in ranges[segment]], rings)


def ring_paths(geometry: MeshGeometry, segment: int, rings: Rings) -> list[list[int]]:
    """Crossings that each muscle of a segment runs through: one closed path, or a left and a right half."""
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


def _add_muscle(spec: mujoco.MjSpec, name: str, path: list[int], span: list[float], rings: Rings) -> None:
    tendon = spec.add_tendon(name=name, width=0.003, rgba=RING_RGBA)
    for crossing in path:
        tendon.wrap_site(crossing_site(crossing))
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
        force=rings.peak_force_N,
        lmin=rings.minimum_length,
        lmax=rings.maximum_length,
        vmax=rings.maximum_velocity,
        fpmax=rings.passive_peak,
        fvmax=rings.lengthening_peak,
    )
    if not rings.activation_dynamics:
        actuator.dyntype = mujoco.mjtDyn.mjDYN_NONE
    _add_length_sensor(spec, name)
    spec.add_sensor(
        name=f"{name}_force",
        type=mujoco.mjtSensor.mjSENS_ACTUATORFRC,
        objtype=mujoco.mjtObj.mjOBJ_ACTUATOR,
        objname=name,
    )


def _add_length_sensor(spec: mujoco.MjSpec, tendon: str) -> None:
    """Adds the engine's own sensor of a tendon's length, for users of the written MJCF."""
    spec.add_sensor(
        name=f"{tendon}_length",
        type=mujoco.mjtSensor.mjSENS_TENDONPOS,
        objtype=mujoco.mjtObj.mjOBJ_TENDON,
        objname=tendon,
    )
