"""Through pipes: speed in bends for several controllers, and a wave that adapts to a narrowing bore or does not."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import pi
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from annelid.analysis import Passage, passage_of
from annelid.draw import canvas, draw_lines, line_looks, panel_title, save_both
from annelid.experiment import Case, Store
from annelid.morphology import Array
from annelid.simulation import Run
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

PRESET = "riddle2025-muscles"
CM = 100.0
WINDOW_S = 5.25
"""Speed and drive are drawn as means over this time, the undriven wave's cycle."""
BASE: dict[str, Any] = {"record.signals_interval_s": 0.02, "record.frames_interval_s": 0.1}
RADII_M = (0.3, 0.4, 0.5, 0.6, 0.9, 1.3)
QUICK_RADII_M = (0.3,)

TURN_S = 0.27
"""Time from one segment to the next in bends: about that of the paper's network on this body on open ground."""
TIMED = {"controller": {"kind": "timed", "rise_s": TURN_S, "hold_s": TURN_S, "fall_s": TURN_S, "interval_s": TURN_S}}
LIFT, MOTOR_TIME_CONSTANT_S = 0.45, 0.35
FIXED, ADAPTIVE, PAPERS = "fixed", "adaptive", "paper's SNS"
SLOW_S, FAST_S = 45.0, 30.0


def _robust(**changes: Any) -> dict[str, Any]:
    return {"controller": {"kind": "sns-robust", "motor_time_constant_s": MOTOR_TIME_CONSTANT_S, **changes}}


BEND_GAITS: Mapping[str, Mapping[str, Any]] = {
    "timed 3x1": TIMED,
    "reactive": {**TIMED, "turning": {"kind": "touch"}},
    PAPERS: {},
    "robust SNS": _robust(turn_ms=1e3 * TURN_S),
}
"""All on half-rings; the reactive one is the timed one that turns away from contact as the authors published it."""
NARROW_GAITS: Mapping[str, Mapping[str, Any]] = {
    FIXED: {"duration_s": SLOW_S, **_robust()},
    ADAPTIVE: {"duration_s": SLOW_S, **_robust(descending={"lift": LIFT})},
    "full drive": {"duration_s": FAST_S, **_robust(descending={"lift": LIFT, "drive": 1.0})},
    PAPERS: {"duration_s": FAST_S},
    "timed 3x1": {"duration_s": FAST_S, **TIMED},
}
"""The first three are one network: without drive, with that of pressed backs, and with full drive throughout."""
NARROW_ARENAS: Mapping[str, Mapping[str, Any]] = {
    "taper": {"kind": "pipe", "bore_m": 0.18, "profile": "taper", "narrowest_m": 0.13},
    "hourglass": {"kind": "pipe", "bore_m": 0.18, "profile": "hourglass", "narrowest_m": 0.13, "profile_length_m": 1.0},
}
CONTACTS = {"contact_time_constant_s": 0.01, "contact_impedance": [0.99, 0.999, 0.001], "friction": 0.7}
"""As the catalogue's pipes have them, with the preset's friction."""
BEND_SPEED_M_PER_S = 0.1
"""Runs in bends last as long as a worm of this speed takes to bring its middle through."""


DRAWN_RADIUS_M = 0.6
"""Radius of the bend in which gaits are compared over several frictions."""


class Trial(NamedTuple):
    """One worm in one pipe."""

    arena: str  # Kind of pipe: ``"bend"``, or a key of `NARROW_ARENAS`
    gait: str  # Key of `BEND_GAITS` or `NARROW_GAITS`
    radius_m: float  # Radius of the bend's centre line; 0 for a straight pipe
    case: Case  # Its run

    @property
    def is_drawn(self) -> bool:
        """Whether it is run with eight frictions as well, and once at half the step."""
        return self.gait != PAPERS and self.radius_m in (0.0, DRAWN_RADIUS_M)


@dataclass(frozen=True, slots=True)
class Reading:
    """What the run of a trial says; NaN and None where it cannot."""

    arena: str  # As the trial's
    gait: str  # As the trial's
    radius_m: float  # As the trial's
    passed: bool  # Whether the middle of the worm came out of what bends or narrows
    speed_m_per_s: float  # Speed of the foremost ring along the centre line through there
    drawn_speed_m_per_s: float  # The same, mean over runs with frictions within one percent; NaN without them
    drawn_speed_low: float  # Ends of its 95 % interval
    drawn_speed_high: float
    half_step_change_m_per_s: float  # What half the step changes of it, in the first of those runs
    front_m: float  # Arc length that the foremost ring came to
    in_order: bool | None  # Whether segments contracted in the order 1-2-..-N throughout
    work_J_per_m: float | None  # Net work of the muscles per metre of the middle's path, over the whole run
    slip_ratio: float | None  # Distance that segments slide over that of the centre of mass
    command: str  # The command line that makes the run


class Course(NamedTuple):
    """What is drawn of one run in a pipe that narrows, at the times of its postures, each ``(n,)``."""

    front_m: Array  # Where the foremost ring is along the centre line, m
    bore_m: Array  # Radius of the bore there, m
    speed_m_per_s: Array  # Speed of the middle, m/s
    drive: Array  # Activity of the descending neuron; zeros without one
    first_ring_m: Array  # Length of the foremost ring, m


Courses = Mapping[tuple[str, str], Course]
"""By pipe and gait."""


def trials(quick: bool = False) -> list[Trial]:
    """Lays out the runs; quick: only the taper, fixed and adaptive, and one radius."""
    made = []
    for arena, shape in list(NARROW_ARENAS.items())[: 1 if quick else None]:
        for name in (FIXED, ADAPTIVE) if quick else NARROW_GAITS:
            changes = {"arena": {**shape, **CONTACTS}, **NARROW_GAITS[name], **BASE}
            made.append(Trial(arena, name, 0.0, Case(PRESET, changes)))
    for radius in QUICK_RADII_M if quick else RADII_M:
        bend = {"kind": "pipe", "course": "bend", "bore_m": 0.18, "radius_m": radius, **CONTACTS}
        duration = round((0.5 * pi * radius + 0.8) / BEND_SPEED_M_PER_S, 0)
        for name, own in BEND_GAITS.items():
            changes = {"arena": bend, "body.rings.layout": "halves", **own, "duration_s": duration, **BASE}
            made.append(Trial("bend", name, radius, Case(PRESET, changes)))
    return made


def _course(run: Run, passage: Passage) -> Course:
    data, time = run.data, run.data["time"].values
    rings = data["ring_length"].values.reshape(len(time), run.config.body.n_segments, -1).sum(axis=2)
    drive = data["drive"].values if "drive" in data else np.zeros(len(time))
    smooth = np.array([drive[np.abs(time - now) <= WINDOW_S / 2].mean() for now in passage.time_s])
    first_ring = np.interp(passage.time_s, time, rings[:, 0])
    return Course(passage.front_m, passage.bore_m[:, 0], passage.speed_over_m_per_s(WINDOW_S), smooth, first_ring)


def study(store: Store, output: Path, effort: Effort) -> Results:
    """The study `pipes`; a run that ended before its second posture is a RunFileError."""
    wanted = trials(effort == "quick")
    store.compute([trial.case for trial in wanted], "pipes")
    drawn = {trial[:3]: trial.case for trial in wanted if effort == "full" and trial.is_drawn}
    further = over_frictions(store, drawn, lambda _, case: passage_of(store.run(case)).speed_m_per_s())
    readings, courses = [], {}
    for trial in wanted:
        run = store.run(trial.case)
        mean, low, high, change = further.get(trial[:3], NOT_DRAWN)
        passage, found = passage_of(run), store[trial.case].summary
        work_J = found.energy_muscle_work_J
        path_m = float(passage.middle_m[-1] - passage.middle_m[0])
        readings.append(
            Reading(
                *trial[:3],
                passed=passage.passed,
                speed_m_per_s=passage.speed_m_per_s(),
                drawn_speed_m_per_s=mean,
                drawn_speed_low=low,
                drawn_speed_high=high,
                half_step_change_m_per_s=change,
                front_m=float(passage.front_m.max()),
                in_order=found.wave,
                work_J_per_m=None if work_J is None or path_m <= 0 else work_J / path_m,
                slip_ratio=found.slip_ratio,
                command=trial.case.command,
            )
        )
        if trial.gait in (FIXED, ADAPTIVE):
            courses[trial.arena, trial.gait] = _course(run, passage)
    path = write_fields(Reading, readings, output / "pipes.csv")
    return (path, pipes_picture(readings, courses, path.with_suffix(""))), [pipes_table(readings)]


def pipes_table(readings: Sequence[Reading]) -> TerminalTable:
    """Lays out readings for the terminal."""
    columns: Mapping[str, Callable[[Reading], str]] = {
        "pipe": lambda one: f"bend {one.radius_m:g} m" if one.radius_m else one.arena,
        "gait": lambda one: one.gait,
        "passed": lambda one: YES[one.passed],
        "speed (cm/s)": lambda one: (
            interval(CM * one.drawn_speed_m_per_s, CM * one.drawn_speed_low, CM * one.drawn_speed_high)
            or f"{CM * one.speed_m_per_s:.2f}"
        ),
        "front at (m)": lambda one: f"{one.front_m:.2f}",
        "in order": lambda one: YES[one.in_order],
        "net work (J/m)": lambda one: "-" if one.work_J_per_m is None else f"{one.work_J_per_m:.0f}",
        "slip ratio": lambda one: "-" if one.slip_ratio is None else f"{one.slip_ratio:.2f}",
    }
    caption = "after ±: half of the 95 % interval over eight frictions"
    return terminal_table(tabulated(readings, columns), "Pipes", n_words=2, caption=caption)


def pipes_picture(readings: Sequence[Reading], courses: Courses, stem: Path) -> Path:
    """Draws why adaptation pays, a column for every narrowing pipe, and speed against the bends' radius below."""
    pipes = grouped(courses, lambda of: of[0])
    with canvas(8.4) as figure:
        grid = figure.add_gridspec(4, max(len(pipes), 1), height_ratios=[1.0, 1.0, 1.0, 1.4])
        for column, (pipe, keys) in enumerate(pipes.items()):
            rows = [figure.add_subplot(grid[row, column]) for row in range(3)]
            _draw_pipe(rows, pipe, {key[1]: courses[key] for key in keys})
            if column == 0:
                rows[0].legend(loc="best")
        _draw_bends(figure.add_subplot(grid[3, :]), [one for one in readings if one.radius_m])
        return save_both(figure, stem)


def _draw_pipe(rows: Sequence[Axes], pipe: str, courses: Mapping[str, Course]) -> None:
    """Draws speed, drive and foremost ring over the place in a narrowing pipe, a line a gait."""
    speed, drive, ring = rows
    panel_title(speed, f"{pipe}: speed of the middle (cm/s)")
    panel_title(drive, "drive of the descending neuron")
    panel_title(ring, "perimeter of the foremost ring (cm); grey: bore")
    for look, (name, one) in zip(line_looks(3), courses.items(), strict=False):
        lines = (CM * one.speed_m_per_s, one.drive, CM * one.first_ring_m)
        for axes, values in zip(rows, lines, strict=True):
            axes.plot(one.front_m, values, label=name, **look, linewidth=1.1)
    farthest = max(courses.values(), key=lambda one: one.front_m.max())
    order = np.argsort(farthest.front_m)
    # The ring is the hexagon of six crossings that lie in the bore.
    bore_cm = CM * 6.0 * farthest.bore_m[order]
    ring.plot(farthest.front_m[order], bore_cm, color="0.65", linewidth=2.2, zorder=1)
    ring.set_xlabel("place of the foremost ring along the pipe (m)")
    drive.set_ylim(-0.05, 1.05)


def _draw_bends(axes: Axes, readings: Sequence[Reading]) -> None:
    own = {gait: [one for one in readings if one.gait == gait] for gait in BEND_GAITS}
    lines = {gait: ([one.radius_m for one in of], [CM * one.speed_m_per_s for one in of]) for gait, of in own.items()}
    draw_lines(axes, lines, markerfacecolor="none")
    for drawn in [line for line in axes.lines if line.get_label() in own]:
        passed = [(one.radius_m, CM * one.speed_m_per_s) for one in own[str(drawn.get_label())] if one.passed]
        style = {"color": drawn.get_color(), "marker": drawn.get_marker(), "linestyle": "none"}
        axes.plot(*np.reshape(passed, (-1, 2)).T, **style)
    panel_title(axes, "Bends of 90 degrees: speed along the centre line (cm/s); filled: the worm came through")
    axes.set_xlabel("radius of the centre line (m)")
    axes.set_ylim(bottom=0.0)
    axes.legend(loc="best", ncols=2)
