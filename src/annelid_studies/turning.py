"""The radius on which a worm with half-rings turns, against the modulation of its sides."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from annelid.analysis import Track, track_of
from annelid.draw import canvas, draw_lines, line_looks, panel_title, save_both
from annelid.errors import RunFileError
from annelid.experiment import Case, Store
from annelid_studies.standard_cases import NOT_DRAWN, Effort, over_frictions
from annelid_studies.tables import (
    YES,
    Results,
    TerminalTable,
    grouped,
    interval,
    tabulated,
    terminal_table,
    write_fields,
)

COUNTER = (1.0, 1.0, -1.0, -1.0, 1.0, 1.0)
"""Shares of six segments: the ends bend to one side, the middle to the other."""
MODULATIONS = (-0.9, -0.6, -0.3, 0.0, 0.3, 0.6, 0.9)
DRAWN = (-0.6, 0.6)
"""Modulations that are run with eight frictions as well, and once at half the step."""
LARGEST_RADIUS_M = 20.0
"""Where the axis of the radius ends: a worm that turns more weakly than this goes straight."""


@dataclass(frozen=True, slots=True)
class Turn:
    """How a worm turned over complete cycles.

    Attributes:
        cycles: Complete cycles between the two ends.
        angle_rad: Change of the heading, positive to the left.
        path_m: Length of the path of the middle of the body, from cycle to cycle.
        curvature_per_m: Angle over path; positive to the left.
    """

    cycles: int
    angle_rad: float
    path_m: float
    curvature_per_m: float

    @property
    def deg_per_cycle(self) -> float:
        """Change of the heading in a cycle, degrees."""
        return math.degrees(self.angle_rad) / self.cycles

    @property
    def radius_m(self) -> float:
        """Radius of the circle, m; infinite for a straight path, NaN for one of no length."""
        return np.inf if self.curvature_per_m == 0 else abs(1.0 / self.curvature_per_m)


def turn_of(track: Track, period_s: float, after_s: float = 0.0) -> Turn:
    """Measures the turn over as many complete cycles as there are.

    Samples a cycle apart are compared, so that the swings within a cycle do not count; angle and path are means over
    every phase of the cycle.

    Args:
        track: The track.
        period_s: Time of a cycle, s.
        after_s: Time from which on it is measured, so that the start is left out, s.

    Raises:
        RunFileError: Less than two complete cycles behind ``after_s``.
    """
    first, last = max(after_s, float(track.time_s[0])), float(track.time_s[-1])
    # The last complete cycle serves to average over its phases.
    hops = int((last - first) / period_s + 1e-9) - 1 if period_s > 0 else 0
    if hops < 1:
        raise RunFileError(
            f"a turn takes at least two cycles of {period_s:g} s, not the {last - first:.4g} s from {first:.4g} s on"
        )
    phases = np.linspace(0.0, period_s, 64, endpoint=False)
    times = first + phases[:, np.newaxis] + period_s * np.arange(hops + 1)
    x, y, heading = (np.interp(times, track.time_s, values) for values in (*track.middle_m.T, track.heading_rad))
    path = float(np.hypot(np.diff(x, axis=1), np.diff(y, axis=1)).sum(axis=1).mean())
    angle = float((heading[:, -1] - heading[:, 0]).mean())
    return Turn(hops, angle, path, angle / path if path > 0 else float("nan"))


@dataclass(frozen=True)
class Gait:
    """A pattern on a body."""

    name: str  # What tables and figures call it
    preset: str  # Preset of body and pattern
    cycle_s: float  # Time of a cycle; of a nervous system about that, and its rhythm has the exact one
    cycles: int  # Cycles that a run takes; the first is left out
    changes: Mapping[str, Any] = field(default_factory=dict)  # Fields that differ from the preset
    shares: tuple[float, ...] | None = None  # Shares of the segments in the modulation; None for all alike

    def case(self, modulation: float) -> Case:
        """Returns its run under a constant modulation."""
        turning: dict[str, Any] = {"kind": "constant", "modulation": modulation}
        if self.shares is not None:
            turning["shares"] = list(self.shares)
        own = {**self.changes, "turning": turning, "duration_s": round(self.cycle_s * self.cycles, 9)}
        return Case(self.preset, {**own, "record.signals_interval_s": 0.02, "record.frames_interval_s": 0.1})


SNS_ON_HALVES = {"body.rings.layout": "halves", "sensor.tolerance_m": 0.008}
"""Ideal muscles on half-rings, and the tolerance at which their wave survives the strongest modulation studied."""
GAITS = (
    Gait("3x1, all segments alike", "riddle2025-3x1", 6.0, 5),
    Gait("3x1, middle bent back", "riddle2025-3x1", 6.0, 5, shares=COUNTER),
    Gait("SNS, middle bent back", "riddle2025-muscles", 2.5, 6, SNS_ON_HALVES, COUNTER),
)


@dataclass(frozen=True, slots=True)
class Reading:
    """What one run under a constant modulation says."""

    gait: str  # Name of the gait
    modulation: float  # Positive to the left, and so are the turn and its curvature
    # Whether segments contracted in the order 1-2-..-N throughout; None if the run is too short to tell
    wave: bool | None
    cycle_s: float  # Time of a cycle
    speed_m_per_s: float  # Path of the body's middle from cycle to cycle, over time
    turn_deg_per_cycle: float  # Change of the heading
    drawn_turn_deg_per_cycle: float  # The same, mean over runs with frictions within one percent; NaN without them
    drawn_turn_low: float  # Ends of its 95 % interval
    drawn_turn_high: float
    half_step_change_deg_per_cycle: float  # What half the step changes of it, in the first of those runs
    curvature_per_m: float  # Turn over the path
    radius_m: float  # Radius of the circle; infinite for a straight path
    roll_deg: float  # Farthest that the body rolled about its length since the start, positive where its left side rose
    command: str  # The command line that makes the run


def study(store: Store, output: Path, effort: Effort) -> Results:
    """The study `turning`; a run that ended before its second cycle is a RunFileError."""
    modulations = DRAWN if effort == "quick" else MODULATIONS
    cases = [(gait, modulation, gait.case(modulation)) for gait in GAITS for modulation in modulations]
    store.compute([case for _, _, case in cases], "turning")

    def read(gait: Gait, case: Case) -> tuple[Track, float, Turn]:
        track, found = track_of(store.run(case)), store[case].summary
        timed = not case.config.controller.sensor_fields
        cycle_s = gait.cycle_s if timed or found.period_s is None else found.period_s
        return track, cycle_s, turn_of(track, cycle_s, after_s=cycle_s)

    drawn = {i: case for i, (_, at, case) in enumerate(cases) if effort == "full" and at in DRAWN}
    further = over_frictions(store, drawn, lambda i, case: read(cases[i][0], case)[2].deg_per_cycle)
    readings, tracks = [], []
    for i, (gait, modulation, case) in enumerate(cases):
        track, cycle_s, turn = read(gait, case)
        found = store[case].summary
        mean, low, high, change = further.get(i, NOT_DRAWN)
        readings.append(
            Reading(
                gait=gait.name,
                modulation=modulation,
                wave=found.wave,
                cycle_s=cycle_s,
                speed_m_per_s=turn.path_m / (turn.cycles * cycle_s),
                turn_deg_per_cycle=turn.deg_per_cycle,
                drawn_turn_deg_per_cycle=mean,
                drawn_turn_low=low,
                drawn_turn_high=high,
                half_step_change_deg_per_cycle=change,
                curvature_per_m=turn.curvature_per_m,
                radius_m=turn.radius_m,
                roll_deg=math.degrees(track.roll_rad[np.abs(track.roll_rad).argmax()]),
                command=case.command,
            )
        )
        tracks.append(track)
    path = write_fields(Reading, readings, output / "turning.csv")
    return (path, turning_picture(readings, tracks, path.with_suffix(""))), [turning_table(readings)]


def turning_table(readings: Sequence[Reading]) -> TerminalTable:
    """Lays out readings for the terminal."""
    columns: Mapping[str, Callable[[Reading], str]] = {
        "gait": lambda one: one.gait,
        "modulation": lambda one: f"{one.modulation:g}",
        "in order": lambda one: YES[one.wave],
        "cycle (s)": lambda one: f"{one.cycle_s:.2f}",
        "speed (m/s)": lambda one: f"{one.speed_m_per_s:.3f}",
        "turn a cycle (°)": lambda one: (
            interval(one.drawn_turn_deg_per_cycle, one.drawn_turn_low, one.drawn_turn_high)
            or f"{one.turn_deg_per_cycle:.1f}"
        ),
        "radius (m)": lambda one: "> 100" if one.radius_m >= 100.0 else f"{one.radius_m:.2g}",
        "rolled (°)": lambda one: f"{one.roll_deg:.0f}",
    }
    caption = "after ±: half of the 95 % interval over eight frictions"
    return terminal_table(tabulated(readings, columns), "Turning", caption=caption)


def turning_picture(readings: Sequence[Reading], tracks: Sequence[Track], stem: Path) -> Path:
    """Draws curvature and radius of every gait against modulation, and the tracks of the last gait.

    The tracks are the middles of the body, every one from the same start, with the outline at the end.
    """
    curvatures = {
        gait: ([one.modulation for one in own], np.array([one.curvature_per_m for one in own]))
        for gait, own in grouped(readings, lambda one: one.gait).items()
    }
    radii = {gait: (x, 1.0 / np.maximum(np.abs(bend), 1e-9)) for gait, (x, bend) in curvatures.items()}
    shown = list(curvatures)[-1]
    pairs = zip(readings, tracks, strict=True)
    of_shown = {one.modulation: track for one, track in pairs if one.gait == shown}
    with canvas(5.6) as figure:
        grid = figure.add_gridspec(2, 2, width_ratios=[1.0, 1.25])
        curvature, radius = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[1, 0])
        draw_lines(curvature, curvatures, markersize=4.5)
        panel_title(curvature, "Positive to the left")
        curvature.set(xlabel="modulation", ylabel="curvature (1/m)")
        draw_lines(radius, radii, markersize=4.5)
        radius.set(ylabel="radius (m)", xlabel="modulation", yscale="log")
        radius.set_ylim(top=LARGEST_RADIUS_M)
        from_above = figure.add_subplot(grid[:, 1])
        for (modulation, track), look in zip(sorted(of_shown.items()), line_looks(len(of_shown)), strict=True):
            start = track.middle_m[0]
            from_above.plot(*(track.middle_m - start).T, **look, linewidth=1.4, label=f"{modulation:g}")
            from_above.plot(*(track.outline_m(-1) - start).T, **look, linewidth=0.6)
        from_above.set_aspect("equal")
        from_above.set(xlabel="x (m)", ylabel="y (m)")
        from_above.legend(title="modulation", loc="upper center", bbox_to_anchor=(0.5, -0.28), ncols=4)
        panel_title(from_above, f"{shown}: tracks")
        handles, labels = curvature.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
        return save_both(figure, stem)
