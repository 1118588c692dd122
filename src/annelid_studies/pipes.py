"""Through pipes: speed in bends for several controllers, and a wave that adapts to a narrowing bore or does not."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from annelid.analysis import Passage, gait, passage_of
from annelid.draw import canvas, draw_lines, panel_title, save_both, segment_colors
from annelid.experiment import Case, Store, StudyProgress, in_stage
from annelid.morphology import Array
from annelid_studies.tables import tabulated, terminal_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from rich.table import Table as TerminalTable

    from annelid.simulation import Run

PRESET = "riddle2025-muscles"
CM = 100.0
WINDOW_S = 5.25
"""Speed and drive are drawn as means over this time, the undriven wave's cycle."""
BASE: dict[str, Any] = {"record.signals_interval_s": 0.02, "record.frames_interval_s": 0.1}
RADII_M = (0.3, 0.4, 0.5, 0.6, 0.9, 1.3)
QUICK_RADII_M = (0.3,)

TURN_S = 0.27
"""Time from one segment to the next in bends: about that of the paper's network on this body on open ground."""
TIMED = {
    "controller": {"kind": "timed", "rise_s": TURN_S, "hold_s": TURN_S, "fall_s": TURN_S, "interval_s": TURN_S},
}
LIFT, LET_GO_S = 0.45, 0.35
FIXED, ADAPTIVE = "fixed", "adaptive"
SLOW_S, FAST_S = 45.0, 30.0


def _robust(**changes: Any) -> dict[str, Any]:
    return {"controller": {"kind": "sns-robust", "let_go_s": LET_GO_S, **changes}}


BEND_GAITS: Mapping[str, Mapping[str, Any]] = {
    "timed 3x1": TIMED,
    "reactive": {**TIMED, "turning": {"kind": "touch"}},
    "paper's SNS": {},
    "robust SNS": _robust(turn_ms=1e3 * TURN_S),
}
"""All on half-rings; the reactive one is the timed one that turns away from contact as the authors published it."""
NARROW_GAITS: Mapping[str, Mapping[str, Any]] = {
    FIXED: {"duration_s": SLOW_S, **_robust()},
    ADAPTIVE: {"duration_s": SLOW_S, **_robust(descending={"lift": LIFT})},
    "full drive": {"duration_s": FAST_S, **_robust(descending={"lift": LIFT, "drive": 1.0})},
    "paper's SNS": {"duration_s": FAST_S},
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


@dataclass(frozen=True)
class Trial:
    """One worm in one pipe.

    Attributes:
        arena: Kind of pipe: ``"bend"``, or a key of `NARROW_ARENAS`.
        gait: Key of `BEND_GAITS` or `NARROW_GAITS`.
        radius_m: Radius of the bend's centre line; 0 for a straight pipe.
        case: Its run.
    """

    arena: str
    gait: str
    radius_m: float
    case: Case


@dataclass(frozen=True, slots=True)
class Reading:
    """What one run says; NaN and None where it cannot.

    Attributes:
        arena: As the trial's.
        gait: As the trial's.
        radius_m: As the trial's.
        passed: Whether the middle of the worm came out of what bends or narrows.
        speed_m_per_s: Speed of the foremost ring along the centre line through there.
        front_m: Arc length that the foremost ring came to.
        in_order: Whether segments contracted in the order 1-2-..-N throughout.
        work_J_per_m: Net work of the muscles per metre of the middle's way, over the whole run.
        slip_ratio: Way that segments slide over that of the centre of mass.
        command: The command line that makes the run.
    """

    arena: str
    gait: str
    radius_m: float
    passed: bool
    speed_m_per_s: float
    front_m: float
    in_order: bool | None
    work_J_per_m: float | None
    slip_ratio: float | None
    command: str


@dataclass(frozen=True)
class Way:
    """What is drawn of one run in a pipe that narrows, at the times of its postures.

    Attributes:
        front_m: Where the foremost ring is along the centre line, m, ``(n,)``.
        bore_m: Radius of the bore there, m, ``(n,)``.
        speed_m_per_s: Speed of the middle, m/s, ``(n,)``.
        drive: Activity of the descending neuron, ``(n,)``; zeros without one.
        first_ring_m: Length of the foremost ring, m, ``(n,)``.
    """

    front_m: Array
    bore_m: Array
    speed_m_per_s: Array
    drive: Array
    first_ring_m: Array

    @classmethod
    def of(cls, run: Run, passage: Passage) -> Self:
        """Reads it from a run."""
        data, time = run.data, run.data["time"].values
        rings = data["ring_length"].values.reshape(len(time), run.config.body.n_segments, -1).sum(axis=2)
        drive = data["drive"].values if "drive" in data else np.zeros(len(time))
        smooth = np.array([drive[np.abs(time - now) <= WINDOW_S / 2].mean() for now in passage.time_s])
        return cls(
            passage.front_m,
            passage.bore_m[:, 0],
            passage.speed_over_m_per_s(WINDOW_S),
            smooth,
            np.interp(passage.time_s, time, rings[:, 0]),
        )


@dataclass(frozen=True)
class Passages:
    """All readings, and what the figure of the narrow pipes is drawn from."""

    readings: tuple[Reading, ...]
    ways: Mapping[tuple[str, str], Way]


def trials(quick: bool = False, radii_m: Sequence[float] = RADII_M) -> list[Trial]:
    """Lays out the runs.

    Args:
        quick: Only the taper, fixed and adaptive, and one radius.
        radii_m: Radii of the bends.
    """
    made = []
    for arena, shape in list(NARROW_ARENAS.items())[: 1 if quick else None]:
        for name in (FIXED, ADAPTIVE) if quick else NARROW_GAITS:
            changes = {"arena": {**shape, **CONTACTS}, **NARROW_GAITS[name], **BASE}
            made.append(Trial(arena, name, 0.0, Case(PRESET, changes)))
    for radius in QUICK_RADII_M if quick else radii_m:
        bend = {"kind": "pipe", "course": "bend", "bore_m": 0.18, "radius_m": radius, **CONTACTS}
        duration = round((0.5 * pi * radius + 0.8) / BEND_SPEED_M_PER_S, 0)
        for name, own in BEND_GAITS.items():
            changes = {"arena": bend, "body.rings.layout": "halves", **own, "duration_s": duration, **BASE}
            made.append(Trial("bend", name, radius, Case(PRESET, changes)))
    return made


def pass_pipes(
    store: Store, wanted: Sequence[Trial], *, jobs: int | None = None, progress: StudyProgress | None = None
) -> Passages:
    """Runs every trial, and reads how it went.

    Args:
        store: Where runs are kept.
        wanted: The trials.
        jobs: Runs at a time, by default as many as there are cores.
        progress: Called as the runs go on.

    Raises:
        RunFileError: A run ended before its second posture.
        KeyboardInterrupt: Runs in progress are dropped, all others kept.
    """
    store.compute([trial.case for trial in wanted], jobs=jobs, progress=in_stage(progress, "pipes"))
    readings, ways = [], {}
    for trial in wanted:
        run = store.run(trial.case)
        passage = passage_of(run)
        readings.append(_reading(trial, run, passage, store[trial.case].summary.wave))
        if trial.gait in (FIXED, ADAPTIVE):
            ways[trial.arena, trial.gait] = Way.of(run, passage)
    return Passages(tuple(readings), ways)


def _reading(trial: Trial, run: Run, passage: Passage, wave: bool | None) -> Reading:
    found, way = gait(run), float(passage.middle_m[-1] - passage.middle_m[0])
    return Reading(
        arena=trial.arena,
        gait=trial.gait,
        radius_m=trial.radius_m,
        passed=passage.passed,
        speed_m_per_s=passage.speed_m_per_s(),
        front_m=float(passage.front_m.max()),
        in_order=wave,
        work_J_per_m=None if found.energy is None or way <= 0 else found.energy.muscle_work_J / way,
        slip_ratio=found.slip_ratio,
        command=trial.case.command,
    )


def pipes_table(readings: Sequence[Reading]) -> TerminalTable:
    """Lays out readings as a table for the terminal."""
    yes = {True: "yes", False: "no", None: "-"}
    columns: Mapping[str, Callable[[Reading], str]] = {
        "pipe": lambda one: f"bend of {one.radius_m:g} m" if one.radius_m else one.arena,
        "gait": lambda one: one.gait,
        "passed": lambda one: yes[one.passed],
        "speed (cm/s)": lambda one: f"{CM * one.speed_m_per_s:.2f}",
        "front at (m)": lambda one: f"{one.front_m:.2f}",
        "in order": lambda one: yes[one.in_order],
        "net work (J/m)": lambda one: "-" if one.work_J_per_m is None else f"{one.work_J_per_m:.0f}",
        "slip ratio": lambda one: "-" if one.slip_ratio is None else f"{one.slip_ratio:.2f}",
    }
    return terminal_table(tabulated(readings, columns), "Pipes", n_words=2)


def pipes_picture(found: Passages, stem: str | Path) -> Path:
    """Draws why adaptation pays, a column for every narrowing pipe, and speed against the bends' radius below.

    Args:
        found: What `pass_pipes` found.
        stem: Path without suffix; ``.svg`` and ``.png`` are written.

    Returns:
        The path of the picture in pixels.

    Raises:
        RunFileError: A file cannot be written.
    """
    pipes = list(dict.fromkeys(pipe for pipe, _ in found.ways))
    with canvas(8.4) as figure:
        grid = figure.add_gridspec(4, max(len(pipes), 1), height_ratios=[1.0, 1.0, 1.0, 1.4])
        for column, pipe in enumerate(pipes):
            rows = [figure.add_subplot(grid[row, column]) for row in range(3)]
            _draw_pipe(rows, pipe, {gait: way for (of, gait), way in found.ways.items() if of == pipe})
            if column == 0:
                rows[0].legend(loc="best")
        _draw_bends(figure.add_subplot(grid[3, :]), [one for one in found.readings if one.radius_m])
        return save_both(figure, stem)


def _draw_pipe(rows: Sequence[Axes], pipe: str, ways: Mapping[str, Way]) -> None:
    """Draws speed, drive and foremost ring over the place in a narrowing pipe, a line a gait."""
    speed, drive, ring = rows
    panel_title(speed, f"{pipe}: speed of the middle (cm/s)")
    panel_title(drive, "drive of the descending neuron")
    panel_title(ring, "foremost ring (cm); dashed: the bore")
    for color, (name, way) in zip(segment_colors(3), ways.items(), strict=False):
        lines = (CM * way.speed_m_per_s, way.drive, CM * way.first_ring_m)
        for axes, values in zip(rows, lines, strict=True):
            axes.plot(way.front_m, values, label=name, color=color, linewidth=1.1, alpha=0.85)
    farthest = max(ways.values(), key=lambda way: way.front_m.max())
    order = np.argsort(farthest.front_m)
    # The ring is the hexagon of six crossings that lie in the bore.
    bore_cm = CM * 6.0 * farthest.bore_m[order]
    ring.plot(farthest.front_m[order], bore_cm, color="0.3", linestyle=(0, (4, 3)))
    ring.set_xlabel("foremost ring along the pipe (m)")
    drive.set_ylim(-0.05, 1.05)


def _draw_bends(axes: Axes, readings: Sequence[Reading]) -> None:
    own = {gait: [one for one in readings if one.gait == gait] for gait in BEND_GAITS}
    lines = {gait: ([one.radius_m for one in of], [CM * one.speed_m_per_s for one in of]) for gait, of in own.items()}
    draw_lines(axes, lines, markerfacecolor="none")
    for of, drawn in zip(own.values(), list(axes.lines), strict=True):
        passed = [(one.radius_m, CM * one.speed_m_per_s) for one in of if one.passed]
        style = {"color": drawn.get_color(), "marker": drawn.get_marker(), "linestyle": "none"}
        axes.plot(*np.reshape(passed, (-1, 2)).T, **style)
    panel_title(axes, "Bends of 90 degrees: speed along the centre line (cm/s); filled: the worm came through")
    axes.set_xlabel("radius of the centre line (m)")
    axes.set_ylim(bottom=0.0)
    axes.legend(loc="best", ncols=2)
