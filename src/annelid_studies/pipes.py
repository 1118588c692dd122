"""Through pipes: speed in bends for several controllers, and a wave that adapts to a narrowing bore or does not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Any

from annelid.analysis.gait import Gait, gait
from annelid.analysis.passage import Passage, passage_of
from annelid.experiment.case import Case
from annelid.experiment.progress import StudyProgress, in_stage
from annelid.experiment.store import Store
from annelid.output import write_csv
from annelid_studies.figures.pipes import BendLine, Way, pipes_figure

if TYPE_CHECKING:
    from rich.table import Table

PRESET = "riddle2025-muscles"
STAGE = "pipes"
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
    store.compute(
        [trial.case for trial in wanted],
        jobs=jobs,
        progress=in_stage(progress, STAGE),
    )
    readings, ways = [], {}
    for trial in wanted:
        run = store.run(trial.case)
        passage = passage_of(run)
        readings.append(_reading(trial, passage, gait(run), store[trial.case].summary.wave))
        if trial.gait in (FIXED, ADAPTIVE):
            ways[trial.arena, trial.gait] = Way.of(run, passage)
    return Passages(tuple(readings), ways)


def _reading(trial: Trial, passage: Passage, found: Gait, wave: bool | None) -> Reading:
    way = float(passage.middle_m[-1] - passage.middle_m[0])
    work = None if found.energy is None or way <= 0 else found.energy.muscle_work_J / way
    return Reading(
        trial.arena,
        trial.gait,
        trial.radius_m,
        passage.passed,
        passage.speed_m_per_s(),
        float(passage.front_m.max()),
        wave,
        work,
        found.slip_ratio,
        trial.case.command,
    )


def pipes_table(readings: Sequence[Reading]) -> Table:
    """Lays out readings as a table for the terminal."""
    from rich import box
    from rich.table import Table

    table = Table(title="Pipes", title_justify="left", title_style="bold", box=box.SIMPLE_HEAD, pad_edge=False)
    headings = ("pipe", "gait", "passed", "speed (cm/s)", "front at (m)", "in order", "net work (J/m)", "slip ratio")
    for heading in headings:
        table.add_column(heading, justify="left" if heading in headings[:2] else "right")
    yes = {True: "yes", False: "no", None: "-"}
    for one in readings:
        pipe = f"bend of {one.radius_m:g} m" if one.radius_m else one.arena
        numbers = (
            f"{100 * one.speed_m_per_s:.2f}",
            f"{one.front_m:.2f}",
            yes[one.in_order],
            "-" if one.work_J_per_m is None else f"{one.work_J_per_m:.0f}",
            "-" if one.slip_ratio is None else f"{one.slip_ratio:.2f}",
        )
        table.add_row(pipe, one.gait, yes[one.passed], *numbers)
    return table


def write_readings(readings: Sequence[Reading], path: Path) -> Path:
    """Writes readings as CSV, one row each; returns the path."""
    return write_csv(path, Reading.__slots__, map(astuple, readings))


def pipes_picture(found: Passages, stem: str | Path) -> Path:
    """Draws why adaptation pays, and speed against the bends' radius.

    Args:
        found: What `pass_pipes` found.
        stem: Path without suffix; ``.svg`` and ``.png`` are written.

    Returns:
        The path of the picture in pixels.

    Raises:
        RunFileError: A file cannot be written.
    """
    bends = {
        name: BendLine(
            [one.radius_m for one in found.readings if one.radius_m and one.gait == name],
            [one.speed_m_per_s for one in found.readings if one.radius_m and one.gait == name],
            [one.passed for one in found.readings if one.radius_m and one.gait == name],
        )
        for name in BEND_GAITS
    }
    return pipes_figure(found.ways, bends, stem)
