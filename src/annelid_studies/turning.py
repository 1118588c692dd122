"""The radius on which a worm with half-rings turns, against the modulation of its sides."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from annelid.analysis.track import Track, Turn, track_of, turn_of
from annelid.experiment.case import Case
from annelid.experiment.progress import StudyProgress, in_stage
from annelid.experiment.store import Store
from annelid.output import write_csv
from annelid_studies.figures.turning import turning_figure

if TYPE_CHECKING:
    from rich.table import Table

COUNTER = (1.0, 1.0, -1.0, -1.0, 1.0, 1.0)
"""Shares of six segments: the ends bend to one side, the middle to the other."""
MODULATIONS = (-0.9, -0.6, -0.3, 0.0, 0.3, 0.6, 0.9)
QUICK = (-0.9, 0.9)
STAGE = "turning"


@dataclass(frozen=True)
class Gait:
    """A pattern on a body.

    Attributes:
        name: What tables and figures call it.
        preset: Preset of body and pattern.
        cycle_s: Time of a cycle; of a nervous system about that, which its rhythm then tells.
        cycles: Cycles that a run takes; the first is left out.
        changes: Fields that differ from the preset.
        shares: Shares of the segments in the modulation; None for all alike.
    """

    name: str
    preset: str
    cycle_s: float
    cycles: int
    changes: Mapping[str, Any] = field(default_factory=dict)
    shares: tuple[float, ...] | None = None

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
    """What one run says.

    Attributes:
        gait: Name of the gait.
        modulation: The constant modulation, positive to the left.
        wave: Whether segments contracted in the order 1-2-..-N throughout; None if the run is too short to tell.
        cycle_s: Time of a cycle.
        speed_m_per_s: Way of the body's middle from cycle to cycle, over time.
        turn_deg_per_cycle: Change of the heading, positive to the left.
        curvature_per_m: The same over the way.
        radius_m: Radius of the circle; infinite for a straight way.
        command: The command line that makes the run.
    """

    gait: str
    modulation: float
    wave: bool | None
    cycle_s: float
    speed_m_per_s: float
    turn_deg_per_cycle: float
    curvature_per_m: float
    radius_m: float
    command: str


@dataclass(frozen=True)
class Turned:
    """All readings, and the tracks that they were read from, in the same order."""

    readings: tuple[Reading, ...]
    tracks: tuple[Track, ...]


def turning(
    store: Store,
    modulations: Sequence[float] = MODULATIONS,
    *,
    gaits: Sequence[Gait] = GAITS,
    jobs: int | None = None,
    progress: StudyProgress | None = None,
) -> Turned:
    """Runs every gait under every modulation, and measures the turns.

    Args:
        store: Where runs are kept.
        modulations: Constant modulations.
        gaits: Patterns on bodies.
        jobs: Runs at a time, by default as many as there are cores.
        progress: Called as the runs go on.

    Raises:
        RunFileError: A run ended before its second cycle.
        KeyboardInterrupt: Runs in progress are dropped, all others kept.
    """
    work = [(gait, modulation, gait.case(modulation)) for gait in gaits for modulation in modulations]
    store.compute(
        [case for _, _, case in work],
        jobs=jobs,
        progress=in_stage(progress, STAGE),
    )
    readings, tracks = [], []
    for gait, modulation, case in work:
        track, found = track_of(store.run(case)), store[case].summary
        timed = case.config.controller.kind == "timed"
        cycle_s = gait.cycle_s if timed or found.period_s is None else found.period_s
        turn = turn_of(track, cycle_s, after_s=cycle_s)
        readings.append(_reading(gait, modulation, found.wave, cycle_s, turn, case.command))
        tracks.append(track)
    return Turned(tuple(readings), tuple(tracks))


def _reading(gait: Gait, modulation: float, wave: bool | None, cycle_s: float, turn: Turn, command: str) -> Reading:
    return Reading(
        gait.name,
        modulation,
        wave,
        cycle_s,
        turn.path_m / (turn.cycles * cycle_s),
        math.degrees(turn.angle_rad) / turn.cycles,
        turn.curvature_per_m,
        turn.radius_m,
        command,
    )


def turning_table(readings: Sequence[Reading]) -> Table:
    """Lays out readings as a table for the terminal."""
    from rich import box
    from rich.table import Table

    table = Table(title="Turning", title_justify="left", title_style="bold", box=box.SIMPLE_HEAD, pad_edge=False)
    for heading in ("gait", "modulation", "in order", "cycle (s)", "speed (m/s)", "deg a cycle", "radius (m)"):
        table.add_column(heading, justify="left" if heading == "gait" else "right")
    for one in readings:
        order = {True: "yes", False: "no", None: "-"}[one.wave]
        numbers = (
            f"{one.cycle_s:.2f}",
            f"{one.speed_m_per_s:.3f}",
            f"{one.turn_deg_per_cycle:.1f}",
            f"{one.radius_m:.2f}",
        )
        table.add_row(one.gait, f"{one.modulation:g}", order, *numbers)
    return table


def turning_picture(turned: Turned, stem: str | Path) -> Path:
    """Draws curvature and radius of every gait against modulation, and the tracks of the second gait.

    Args:
        turned: What `turning` found.
        stem: Path without suffix; ``.svg`` and ``.png`` are written.

    Returns:
        The path of the picture in pixels.

    Raises:
        RunFileError: A file cannot be written.
    """
    names = list(dict.fromkeys(reading.gait for reading in turned.readings))
    lines = {
        name: (
            np.array([one.modulation for one in turned.readings if one.gait == name]),
            np.array([one.curvature_per_m for one in turned.readings if one.gait == name]),
        )
        for name in names
    }
    shown = names[min(1, len(names) - 1)]
    tracks = {
        one.modulation: track for one, track in zip(turned.readings, turned.tracks, strict=True) if one.gait == shown
    }
    return turning_figure(lines, tracks, shown, stem)


def write_readings(readings: Sequence[Reading], path: Path) -> Path:
    """Writes readings as CSV, one row each; returns the path."""
    return write_csv(path, Reading.__slots__, map(astuple, readings))
