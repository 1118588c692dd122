"""What pressure feedback saves: the same six-segment worm with and without it, over frictions.

The body is that of a preset of the six-segment robot with ideal muscles, the network that of its controller. Feedback
was tuned on `PRESET` at the frictions `TUNED_AT`; every other friction is a test, and so is every other gait.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from annelid.analysis.slip import SlipCost, slip_cost
from annelid.config import load_config
from annelid.errors import ConfigError
from annelid.experiment.case import Case
from annelid.experiment.progress import StudyProgress, in_stage
from annelid.experiment.store import Store
from annelid.output import write_csv

if TYPE_CHECKING:
    from rich.table import Table

PRESET = "riddle2025-muscles"
GAITS = (PRESET, "crawler")
"""Presets of that robot under the paper's network, as published and tuned for speed."""
TUNED_AT = (0.5, 0.85)
"""Frictions at which the feedback was tuned."""
FRICTIONS = (0.3, 0.5, 0.7, 0.85, 1.0, 1.2, 1.5)
QUICK = (0.7, 1.0)
DURATION_S = 14.0
"""Long enough for four whole cycles behind the first two contractions of segment 1."""
PLAIN, EXTENSION, PRESSURE = "none", "no pressure", "with pressure"
FEEDBACKS = (PLAIN, EXTENSION, PRESSURE)
"""What is fed back beside the paper's stretch sensors: nothing, what of our design needs no touch, all of it."""
COLUMNS = (
    "feedback",
    "friction",
    "cycles",
    "period_s",
    "speed_m_per_s",
    "loss_W",
    "loss_J_per_m",
    "faster_percent",
    "saved_per_s_percent",
    "saved_per_m_percent",
    "one_wave",
)


@dataclass(frozen=True, slots=True)
class Reading:
    """One run.

    Attributes:
        feedback: One of `FEEDBACKS`.
        friction: Of the floor.
        cost: Speed and loss; None where there are no whole cycles to judge.
        one_wave: Whether the segments contract in order, in one wave from front to rear.
    """

    feedback: str
    friction: float
    cost: SlipCost | None
    one_wave: bool


def case(feedback: str, friction: float, preset: str = PRESET) -> Case:
    """Returns the run of one kind of feedback, one of `FEEDBACKS`, on one friction, with one of `GAITS`."""
    changes: dict[str, Any] = {"arena.friction": friction, "duration_s": DURATION_S}
    if feedback != PLAIN:
        changes["controller"] = {"kind": "sns-pressure", "network": load_config(preset).controller.model_dump()}
    if feedback == EXTENSION:
        changes["controller"] |= {"hold": 0.0, "landing": 0.0}
    return Case(preset, changes)


def slip_feedback(
    store: Store,
    frictions: Sequence[float],
    *,
    preset: str = PRESET,
    jobs: int | None = None,
    progress: StudyProgress | None = None,
) -> list[Reading]:
    """Runs the worm with every feedback on every friction, as far as the store does not have it.

    Args:
        store: Where runs are kept.
        frictions: Frictions of the floor.
        preset: One of `GAITS`.
        jobs: Runs at a time, by default as many as there are cores.
        progress: Called at the start and after every run.

    Returns:
        One reading a run, friction by friction.

    Raises:
        ConfigError: Another preset.
        AnnelidError: A run cannot be made.
        KeyboardInterrupt: Finished runs are kept.
    """
    if preset not in GAITS:
        raise ConfigError(f"preset is {preset!r}: must be one of {', '.join(GAITS)}")
    cases = {(friction, feedback): case(feedback, friction, preset) for friction in frictions for feedback in FEEDBACKS}
    store.compute(cases.values(), jobs=jobs, progress=in_stage(progress, "feedback"))
    return [
        Reading(feedback, friction, slip_cost(store.run(one)), store[one].rhythm.is_one_wave)
        for (friction, feedback), one in cases.items()
    ]


def percent(value: float, of: float) -> float:
    """By how much a value is above another one, in percent of that."""
    return 100.0 * (value / of - 1.0)


def compared(readings: Sequence[Reading], reading: Reading) -> tuple[float, float, float] | None:
    """Compares a reading with that without feedback on the same friction.

    Returns:
        Speed gained, loss saved over time, and loss saved over way, in percent; None where either has no cycles.
    """
    [plain] = [one.cost for one in readings if (one.friction, one.feedback) == (reading.friction, PLAIN)]
    own = reading.cost
    if plain is None or own is None:
        return None
    return (
        percent(own.speed_m_per_s, plain.speed_m_per_s),
        -percent(own.loss_W, plain.loss_W),
        -percent(own.loss_J_per_m, plain.loss_J_per_m),
    )


def write_readings(readings: Sequence[Reading], path: Path) -> None:
    """Writes one row a run as CSV with a header.

    Raises:
        RunFileError: The file cannot be written.
    """
    write_csv(path, COLUMNS, (_cells(one, readings) for one in readings))


def _cells(one: Reading, readings: Sequence[Reading]) -> list[object]:
    cost, gains = one.cost, compared(readings, one)
    numbers = (cost.period_s, cost.speed_m_per_s, cost.loss_W, cost.loss_J_per_m) if cost else (float("nan"),) * 4
    texts = [f"{number:.5g}" for number in (*numbers, *(gains or (float("nan"),) * 3))]
    return [one.feedback, f"{one.friction:g}", cost.cycles if cost else 0, *texts, one.one_wave]


def feedback_table(readings: Sequence[Reading], preset: str = PRESET) -> Table:
    """Tabulates speed and loss, and what feedback gains and saves on the same friction."""
    from rich.table import Table

    told = f"* feedback was tuned here{'' if preset == PRESET else f', on {PRESET}'}"
    table = Table(title=f"slip of {preset}, over whole cycles", caption=told)
    for heading in ("friction", "feedback"):
        table.add_column(heading, no_wrap=True)
    for heading in ("wave", "cm/s", "J/m", "faster (%)", "saved (%)", "per m (%)"):
        table.add_column(heading, justify="right")
    for one in readings:
        friction = f"{one.friction:g}{'*' if one.friction in TUNED_AT else ''}"
        wave = "yes" if one.one_wave else "no"
        cost, gains = one.cost, compared(readings, one)
        if cost is None:
            table.add_row(friction, one.feedback, wave, "no whole cycles")
            continue
        percents = [f"{gain:+.0f}" for gain in gains] if gains and one.feedback != PLAIN else []
        speed, joules = f"{100 * cost.speed_m_per_s:.1f}", f"{cost.loss_J_per_m:.2f}"
        table.add_row(friction, one.feedback, wave, speed, joules, *percents)
    return table
