"""Locomotion metrics: speed, stride, slip, cost of transport and turning.

Everything is computed over complete cycles behind the first one, from one contraction of segment 1 to a later one.
docs/evidence/gait.md has the definitions with their formulae and sources.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from annelid.analysis.muscles import cable_work, muscle_work
from annelid.analysis.numbers import number, ratio
from annelid.analysis.rhythm import run_rhythm
from annelid.analysis.track import FORWARDS, fitted_circle, track_of
from annelid.protocols import Array
from annelid.simulation.runfile import Run


@dataclass(frozen=True, kw_only=True)
class Gait:
    """How a worm moves, over complete cycles behind the first one. What cannot be computed is None, never NaN."""

    start_s: float | None = number("beginning of the first complete cycle that counts")
    end_s: float | None = number("end of the last one")
    cycles: int = number("number of complete cycles between them", "complete cycles", default=0)
    gait_period_s: float | None = number("mean duration of these cycles")
    speed_m_per_s: float | None = number(
        "travel of the centre of mass towards the front over time, negative backwards", "speed", "cm/s"
    )
    speed_body_lengths_per_s: float | None = number(
        "speed over the length of the body at rest", "speed", "body lengths/s"
    )
    stride_m: float | None = number("travel towards the front per cycle", "stride", "cm")
    stride_body_lengths: float | None = number("the same over the length of the body at rest", "stride", "body lengths")
    contact_duty: list[float] | None = number(
        "share of the time in which the segment touches the ground", "on the ground", "%", per_segment=True
    )
    slip_ratio: float | None = number(
        "sliding distance on the ground, mean of the segments, over the path of the centre of mass", "slip ratio", "%"
    )
    backward_ratio: float | None = number(
        "travel of the centre of mass away from the front over that towards it; no measure of slip",
        "travel backwards",
        "%",
    )
    cost_of_transport: float | None = number(
        "positive work of the muscles over weight times path: what a muscle takes up is not regained",
        "cost of transport",
    )
    cost_of_transport_net: float | None = number(
        "net work of the muscles over weight times path: what they take up is subtracted", "cost of transport, net"
    )
    cost_of_transport_cables: float | None = number(
        "force times half of every change of length, over weight times path"
    )
    lateral_drift: float | None = number(
        "travel sideways per travel towards the front, positive to the left", "drift to the left", "%"
    )
    heading_change_rad: float | None = number(
        "change of the heading from the first cycle to the last, positive to the left"
    )
    turning_radius_m: float | None = number(
        "radius of the circle through the track, positive to the left; none for a straight one",
        "turning radius",
        "m",
    )


def gait(run: Run) -> Gait:
    """Reads the locomotion metrics of a run, opened with `annelid.open_run`.

    All is None where there is no complete cycle behind the first one.
    """
    marks = cycle_marks(run)
    if marks.size < 2 or "center_of_mass" not in run.variables:
        return Gait()
    time = run.variables["time"].values
    inside = (time >= marks[0]) & (time <= marks[-1])
    signals = {name: one for name, one in run.variables.items() if one.dims[:1] == ("time",)}
    data = {name: one._replace(values=one.values[inside]) for name, one in signals.items()}
    duration, cycles = float(marks[-1] - marks[0]), marks.size - 1
    centre = data["center_of_mass"].values[:, :2]
    steps, headings = _steps(run, marks)
    left = steps[:, 1] * headings[:, 0] - steps[:, 0] * headings[:, 1]
    forwards, path = float((steps * headings).sum(axis=1).sum()), float(np.hypot(*steps.T).sum())
    # Along the mean heading of the window.
    moves = np.diff(centre @ _steps(run, data["time"].values[[0, -1]])[1][0])
    length_m = run.attrs.get("body_length_m")
    mass_kg, arena = run.attrs.get("total_mass_kg"), run.config.arena
    push_J = None if mass_kg is None or arena is None else mass_kg * arena.gravity_m_per_s2 * path
    works = (muscle_work(data, positive=positive) for positive in (True, False))
    positive_J, net_J = (None if work is None else float(work.sum()) for work in works)
    slid_m = float(np.ptp(data["slip_distance"].values, axis=0).mean()) if "slip_distance" in data else None
    touches = (data["contact_force"].values != 0.0).any(axis=2) if "contact_force" in data else None
    angles = np.unwrap(np.arctan2(headings[:, 1], headings[:, 0]))
    circle = fitted_circle(centre)
    return Gait(
        start_s=float(marks[0]),
        end_s=float(marks[-1]),
        cycles=cycles,
        gait_period_s=duration / cycles,
        speed_m_per_s=ratio(forwards, duration),
        speed_body_lengths_per_s=ratio(forwards / duration, length_m),
        stride_m=ratio(forwards, cycles),
        stride_body_lengths=ratio(forwards / cycles, length_m),
        contact_duty=None if touches is None else touches.mean(axis=0).tolist(),
        slip_ratio=ratio(slid_m, path),
        backward_ratio=ratio(float(-moves[moves < 0].sum()), float(moves[moves > 0].sum())),
        cost_of_transport=ratio(positive_J, push_J),
        cost_of_transport_net=ratio(net_J, push_J),
        cost_of_transport_cables=ratio(cable_work(data), push_J),
        lateral_drift=ratio(float(left.sum()), forwards),
        heading_change_rad=None if run.config.body.geometry() is None else float(angles[-1] - angles[0]),
        turning_radius_m=circle.signed_radius_m if circle is not None and circle.is_clear else None,
    )


def cycle_marks(run: Run) -> Array:
    """Returns the times between which cycles lie, s: onsets of segment 1's contractions but the first one."""
    beat = run_rhythm(run)
    return np.array([onset for segment, onset in zip(beat.order, beat.onsets_s, strict=True) if segment == 1][1:])


def _steps(run: Run, marks: Array) -> tuple[Array, Array]:
    """Displacement of the centre of mass and mean heading in each cycle, seen from above, ``(n_cycles, 2)`` each."""
    time = run.variables["time"].values
    centre = run.variables["center_of_mass"].values[:, :2]
    steps = np.diff(np.array([np.interp(marks, time, along) for along in centre.T]).T, axis=0)
    if run.config.body.geometry() is None or run.variables["frame_time"].values.size < 2:
        return steps, np.broadcast_to(FORWARDS, steps.shape)
    track = track_of(run)
    # Evenly over each cycle, whatever the interval of the frames.
    times = marks[:-1, np.newaxis] + np.diff(marks)[:, np.newaxis] * np.linspace(0.0, 1.0, 64, endpoint=False)
    angle = np.interp(times, track.time_s, track.heading_rad).mean(axis=1)
    return steps, -np.array([np.cos(angle), np.sin(angle)]).T
