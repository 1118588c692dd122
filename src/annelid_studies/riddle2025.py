"""The authors' later robot on their own axes: speed over friction on flat ground, and over the radius of bends.

Riddle et al. 2025 and the authors' public scripts say how they ran their model and how they read a speed from it. The
speeds themselves are in figures only: the scripts read them from files that are "too large to upload" (their README).
What the scripts do state as numbers stands below.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, nan
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from annelid.analysis import Track, mean_and_interval, passage_of, track_of
from annelid.draw import canvas, line_looks, panel_title, save_both
from annelid.experiment import Case, Store
from annelid.morphology import Array
from annelid.simulation import Run
from annelid_studies.standard_cases import Effort
from annelid_studies.tables import Results, TerminalTable, grouped, tabulated, terminal_table, write_fields

CM = 100.0
Ground = Literal["flat", "straight pipe", "bend"]

AXIS_M_PER_S = (0.020, 0.044)
"""Vertical axis of the authors' figure of the speed in bends (`Feedback_Control_Model/Turning_Speed_Figures.py`)."""
STRAIGHT_LABEL_M_PER_S = 0.0415
"""Where the label of the straight pipe's speed stands on that axis, its lower edge above the line that it names."""
SMALLEST_RUN_M = 0.5
SMALLEST_DRAWN_M: Mapping[str, float] = {"3x1": 0.7, "3x1, touch": 0.5, "3x1, as in 2026": 0.7}
"""Smallest radius, of 0.5 to 1.3 m, whose speed that figure has; smaller ones are taken out in the script."""

FLAT_GAITS: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "3x1": ("riddle2025-3x1", {}),
    "2x2": ("riddle2025-2x2", {}),
    "3x1, muscles": (
        "riddle2025-muscles",
        {"controller": {"kind": "timed"}, "body.rings.length_range_m": [0.62, 0.96], "body.rings.minimum_length": 0.5},
    ),
}
"""Preset and changes. The authors ran flat ground with 3x1 on the muscles of their model of 2025, which has these
lengths and the engine's default lmin; servos on half-rings are those of 2026."""
PIPE_GAITS: Mapping[str, Mapping[str, Any]] = {
    "3x1": {},
    "3x1, touch": {"turning": {"kind": "touch"}},
    "3x1, as in 2026": {"body.springs.stiffness_N_per_m": 75.0, "body.rings.force_limit_N": 100.0},
}
"""Changes of the preset `riddle2025-3x1`: straight ahead; turning away from contact as the authors published it; with
the springs and the servos' force limit of the model with which they made their figure of the wide pipe."""
FRICTIONS: Mapping[str, tuple[float, ...]] = {
    "3x1": (0.1, 0.3, 0.7, 1.0),
    "2x2": (0.3, 0.7),
    "3x1, muscles": (0.3, 0.7),
}
"""Of flat ground; the authors have 0.01 and 0.1 to 1.0."""
RADII_M: Mapping[str, tuple[float, ...]] = {
    "3x1": (0.3, 0.5, 0.7, 0.9, 1.1, 1.3),
    "3x1, touch": (0.5,),
    "3x1, as in 2026": (),
}
"""Of the bends' centre lines; the authors have 0.2 to 0.9 m with muscles, 0.5 to 1.3 m with servos."""
STRAIGHT_M, PIPE_FRICTION = 0.25, 0.3
PIPE: Mapping[str, Any] = {
    "kind": "pipe",
    "bore_m": 0.20,
    "contact_time_constant_s": 0.01,
    "contact_impedance": [0.99, 0.999, 0.001],
}
"""The authors' wide pipe, 0.20 m in radius, straight for 0.25 m before a bend; contacts as in the catalogue."""
CYCLE_S = 6.0
FLAT_S, AUTHORS_FLAT_S = 12.0, 80.0
"""Two cycles of all three gaits, of which the second is repeated up to the 80 s that the authors simulate."""
BEND_S, BEND_S_PER_M = 36.0, 25.0
"""Runs in bends last so long, and longer with the radius: enough for a worm that does not get stuck; the authors'
last 100 s."""
SHARES = (1.0, 0.99, 1.01)
"""Factors of a point's friction in its runs."""


class Point(NamedTuple):
    """A worm on one ground."""

    ground: Ground
    gait: str
    friction: float
    radius_m: float  # Of the bend's centre line; NaN without one
    half_step: bool  # Whether physics steps are half the preset's: one run, to see what the step does


@dataclass(frozen=True, slots=True)
class Reading:
    """What the runs of a point say."""

    ground: Ground  # As the point's
    gait: str  # As the point's
    friction: float  # As the point's
    radius_m: float  # As the point's
    half_step: bool  # As the point's
    runs: int  # How many runs
    speed_m_per_s: float  # Mean speed of the foremost ring, as the authors define it
    low_m_per_s: float  # Lower end of the mean's 95 % interval; NaN for one run
    high_m_per_s: float  # Upper end
    came_out: int  # Runs whose foremost ring left the bend; 0 without one
    passed: int  # Runs of which the middle of the worm left it
    least_front_m: float  # The least arc length that a foremost ring came to in a bend, or distance elsewhere
    figure: str  # What the authors' figure of the wide pipe has of it: "drawn", "taken out", "not run"; empty elsewhere
    command: str  # The command line that makes the run without a change of friction


def points(quick: bool = False) -> list[Point]:
    """Lays out the points; quick: one friction and one bend, with the authors' 3x1 alone."""
    if quick:
        return [Point("flat", "3x1", 0.3, nan, False), Point("bend", "3x1", PIPE_FRICTION, 0.3, False)]
    flat = [Point("flat", gait, mu, nan, False) for gait in FLAT_GAITS for mu in FRICTIONS[gait]]
    bends = [Point("bend", gait, PIPE_FRICTION, radius, False) for gait in PIPE_GAITS for radius in RADII_M[gait]]
    straight = [Point("straight pipe", gait, PIPE_FRICTION, nan, False) for gait in ("3x1", "3x1, as in 2026")]
    half = [Point("flat", "3x1", 0.3, nan, True), Point("straight pipe", "3x1", PIPE_FRICTION, nan, True)]
    half += [Point("bend", "3x1", PIPE_FRICTION, radius, True) for radius in (0.5, 0.7)]
    return [*flat, *straight, *bends, *half]


def cases(point: Point) -> list[Case]:
    """Returns the runs of a point, that with the point's own friction first."""
    if point.ground == "flat":
        preset, own = FLAT_GAITS[point.gait]
        changes = {**own, "duration_s": FLAT_S}
    else:
        preset, own = "riddle2025-3x1", PIPE_GAITS[point.gait]
        arena, duration_s = {**PIPE, "friction": point.friction}, FLAT_S
        if point.ground == "bend":
            arena |= {"course": "bend", "straight_m": STRAIGHT_M, "radius_m": point.radius_m}
            duration_s = round(BEND_S + BEND_S_PER_M * point.radius_m, 0)
        changes = {**own, "arena": arena, "duration_s": duration_s}
    changes |= {"record.frames_interval_s": 0.1, "record.signals_interval_s": 0.02}
    if point.half_step:
        changes["clock.physics_timestep_s"] = Case(preset).config.clock.physics_timestep_s / 2
    frictions = [round(point.friction * share, 6) for share in SHARES[: 1 if point.half_step else None]]
    return [Case(preset, {**changes, "arena.friction": friction}) for friction in frictions]


def ahead_m(track: Track) -> Array:
    """Returns how far the foremost ring has come along the initial heading, m, ``(n,)``."""
    heading = track.heading_rad[0]
    along: Array = -(track.front_m - track.front_m[0]) @ np.array([np.cos(heading), np.sin(heading)])
    return along


def repeated(time_s: Array, place_m: Array, until_s: float) -> tuple[Array, Array]:
    """Goes on with a path by repeating its last cycle; times are evenly spaced, and a cycle is a whole number of them.

    Returns:
        Times, s, and places, m, ``(n,)`` each.
    """
    per_cycle = round(CYCLE_S / (time_s[1] - time_s[0]))
    stride, last = place_m[-1] - place_m[-1 - per_cycle], place_m[-per_cycle:]
    n = ceil((until_s - time_s[-1]) / CYCLE_S)
    further_time = time_s[-per_cycle:] + CYCLE_S * np.arange(1, n + 1)[:, np.newaxis]
    further = last + stride * np.arange(1, n + 1)[:, np.newaxis]
    time, place = np.append(time_s, further_time), np.append(place_m, further)
    kept = time <= until_s + 1e-9
    return time[kept], place[kept]


def speed_of_line(time_s: Array, place_m: Array) -> float:
    """Speed on flat ground as the authors read it: the slope of a line through the path up to its farthest point, m/s.

    A path that ends behind its start is read up to the point farthest back.
    """
    end = int(place_m.argmin() if place_m[-1] < 0 else place_m.argmax())
    return float(np.polyfit(time_s[:end], place_m[:end], 1)[0]) if end > 1 else 0.0


def _of_run(point: Point, run: Run) -> tuple[float, float, bool, bool]:
    """Speed of the foremost ring, m/s, how far it came, m, and whether it and the middle left the bend."""
    if point.ground != "bend":
        track = track_of(run)
        place = ahead_m(track)
        return speed_of_line(*repeated(track.time_s, place, AUTHORS_FLAT_S)), float(place[-1]), False, False
    passage = passage_of(run)
    farthest = float(passage.front_m.max())
    return passage.speed_m_per_s(), farthest, farthest >= passage.reach_m[1], passage.passed


def in_figure(point: Point) -> str:
    """Returns what the authors' figure of the wide pipe has of a point, as `Reading` says."""
    if point.ground != "bend":
        return ""
    if point.radius_m < SMALLEST_RUN_M:
        return "not run"
    return "drawn" if point.radius_m >= SMALLEST_DRAWN_M[point.gait] else "taken out"


def study(store: Store, output: Path, effort: Effort) -> Results:
    """The study `riddle2025`."""
    runs = {point: cases(point) for point in points(effort == "quick")}
    store.compute([case for of in runs.values() for case in of], "riddle2025")
    readings = []
    for point, own in runs.items():
        found = [_of_run(point, store.run(case)) for case in own]
        speeds, ways, out, passed = zip(*found, strict=True)
        mean = mean_and_interval(speeds)
        counts = sum(out), sum(passed), min(ways)
        readings.append(Reading(*point, len(own), *mean, *counts, in_figure(point), own[0].command))
    path = write_fields(Reading, readings, output / "riddle2025.csv")
    return (path, comparison_picture(readings, path.with_suffix(""))), [comparison_table(readings)]


def comparison_table(readings: Sequence[Reading]) -> TerminalTable:
    """Lays out readings for the terminal."""
    columns: Mapping[str, Callable[[Reading], str]] = {
        # Lines end where they may, so that on a narrow terminal no number breaks.
        "ground": lambda one: f"bend {one.radius_m:g} m" if one.ground == "bend" else one.ground.replace(" ", "\n"),
        "gait": lambda one: (one.gait + (", half step" if one.half_step else "")).replace(", ", ",\n"),
        "friction": lambda one: f"{one.friction:g}",
        "speed (cm/s)": lambda one: f"{CM * one.speed_m_per_s:.2f}",
        "95 % interval (cm/s)": lambda one: (
            "-" if one.runs < 2 else f"{CM * one.low_m_per_s:.2f}..{CM * one.high_m_per_s:.2f}"
        ),
        "front out": lambda one: f"{one.came_out} of {one.runs}" if one.ground == "bend" else "",
        "least way (m)": lambda one: f"{one.least_front_m:.2f}",
    }
    return terminal_table(tabulated(readings, columns), "The authors' later robot", n_words=2)


def comparison_picture(readings: Sequence[Reading], stem: Path) -> Path:
    """Draws speed over friction and over the bends' radius, with what the authors' figure says of the latter."""
    whole = [one for one in readings if not one.half_step]
    with canvas(3.4) as figure:
        flat, bends = figure.subplots(1, 2)
        panel_title(flat, "a) flat ground: speed (cm/s)")
        panel_title(bends, "b) bends, friction 0.3: speed (cm/s)")
        _draw(flat, [one for one in whole if one.ground == "flat"], "friction")
        _draw(bends, [one for one in whole if one.ground == "bend"], "radius_m")
        for one in [one for one in whole if one.ground == "straight pipe" and one.gait == "3x1"]:
            bends.axhline(CM * one.speed_m_per_s, color="0.3", linestyle=(0, (4, 3)), label="3x1, straight pipe")
        bends.axhspan(*(CM * speed for speed in AXIS_M_PER_S), color="0.9", zorder=0, label="range of published axis")
        bends.axhline(CM * STRAIGHT_LABEL_M_PER_S, color="0.6", linestyle="dotted", label="published: straight pipe")
        for height, gait in ((0.97, "3x1"), (0.92, "3x1, touch")):
            least = SMALLEST_DRAWN_M[gait]
            line = bends.get_xaxis_transform()
            bends.plot([least, 1.3], [height, height], color="0.4", linewidth=2.0, transform=line)
            bends.text(
                least - 0.02, height, f"published: {gait}", transform=line, ha="right", va="center", fontsize=6.0
            )
        flat.set_xlabel("friction of the ground")
        bends.set_xlabel("radius of the centre line (m)")
        # Room for the legend.
        flat.set_ylim(0.0, 1.25 * flat.get_ylim()[1])
        bends.set_ylim(0.0, 1.3 * CM * AXIS_M_PER_S[1])
        bends.set_xlim(0.1, 1.4)
        for axes in (flat, bends):
            if axes.get_legend_handles_labels()[0]:
                axes.legend(loc="upper right" if axes is flat else "lower right")
        return save_both(figure, stem)


def _draw(axes: Axes, readings: Sequence[Reading], over: str) -> None:
    gaits = grouped(readings, lambda one: one.gait)
    for (gait, own), look, marker in zip(gaits.items(), line_looks(max(len(gaits), 1)), "os^", strict=False):
        place = [getattr(one, over) for one in own]
        speed, low, high = CM * np.array([(one.speed_m_per_s, one.low_m_per_s, one.high_m_per_s) for one in own]).T
        axes.errorbar(place, speed, [speed - low, high - speed], **look, marker=marker, capsize=2.0, label=gait)
