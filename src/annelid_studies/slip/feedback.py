"""What pressure feedback saves: the same six-segment worm with and without it, over frictions.

The body is that of a preset of the six-segment robot with ideal muscles, the network that of its controller. Feedback
was tuned on `PRESET` at the frictions `TUNED_AT`; every other friction is a test, and so is every other gait.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from annelid.analysis import SlipCost, slip_cost
from annelid.config import load_config
from annelid.draw import canvas, draw_lines, panel_title, save_both
from annelid.errors import ConfigError
from annelid.experiment import Case, Store, StudyProgress, in_stage
from annelid.markdown import Table
from annelid.output import write_csv
from annelid_studies.tables import terminal_table

if TYPE_CHECKING:
    from rich.table import Table as TerminalTable

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
LOSS_TICKS = (2, 5, 10, 20, 50, 100)
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


def feedback_table(readings: Sequence[Reading], preset: str = PRESET) -> TerminalTable:
    """Tabulates speed and loss, and what feedback gains and saves on the same friction."""
    rows = []
    for one in readings:
        cost, gains = one.cost, compared(readings, one)
        numbers = ["no whole cycles", "", *[""] * 3]
        if cost is not None:
            percents = [f"{gain:+.0f}" for gain in gains] if gains and one.feedback != PLAIN else [""] * 3
            numbers = [f"{100 * cost.speed_m_per_s:.1f}", f"{cost.loss_J_per_m:.2f}", *percents]
        friction = f"{one.friction:g}{'*' if one.friction in TUNED_AT else ''}"
        rows.append([friction, one.feedback, "yes" if one.one_wave else "no", *numbers])
    header = ["friction", "feedback", "wave", "cm/s", "J/m", "faster (%)", "saved (%)", "per m (%)"]
    caption = f"* feedback was tuned here{'' if preset == PRESET else f', on {PRESET}'}"
    return terminal_table(Table(header, rows), f"slip of {preset}, over whole cycles", n_words=2, caption=caption)


def feedback_figure(readings: Sequence[Reading], preset: str, stem: str | Path) -> Path:
    """Draws loss per metre and speed against friction; dotted lines where the preset's feedback was tuned.

    Args:
        readings: What `slip_feedback` found.
        preset: One of `GAITS`.
        stem: Path without suffix; ``.svg`` and ``.png`` are written.

    Returns:
        The path of the picture in pixels.

    Raises:
        RunFileError: A file cannot be written.
    """
    costs: dict[str, tuple[list[float], list[float]]] = {}
    speeds: dict[str, tuple[list[float], list[float]]] = {}
    for feedback in FEEDBACKS:
        own = [(one.friction, one.cost) for one in readings if one.feedback == feedback and one.cost is not None]
        if own:
            frictions = [friction for friction, _ in own]
            costs[feedback] = frictions, [cost.loss_J_per_m for _, cost in own]
            speeds[feedback] = frictions, [100 * cost.speed_m_per_s for _, cost in own]
    tuned_at = TUNED_AT if preset == PRESET else ()
    with canvas(3.0) as figure:
        cost, pace = figure.subplots(1, 2)
        for axes, lines in ((cost, costs), (pace, speeds)):
            axes.set_xlabel("friction of the floor" + (" (dotted: tuned here)" if tuned_at else ""))
            for friction in tuned_at:
                axes.axvline(friction, color="0.35", linewidth=0.8, linestyle=":")
            draw_lines(axes, lines, markersize=4)
        panel_title(cost, "What slip costs")
        cost.set(ylabel="work lost to friction (J/m)", yscale="log")
        cost.set_yticks(LOSS_TICKS, [f"{loss}" for loss in LOSS_TICKS])
        cost.minorticks_off()
        cost.legend(title="feedback")
        panel_title(pace, "How fast it is")
        pace.set_ylabel("speed (cm/s)")
        pace.set_ylim(bottom=0.0)
        return save_both(figure, stem)
