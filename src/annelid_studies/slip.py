"""Slip: what pressure feedback saves of its cost, and how well a robot can detect it from stretch and pressure.

The same six-segment worm crawls with and without feedback, over frictions. Its body is that of a preset of the
six-segment robot with ideal muscles, the network that of its controller. Feedback was tuned on `PRESET` at the
frictions `TUNED_AT`; every other friction is a test, and so is every other gait. The detector's constants were chosen
on one run, `CHOSEN_ON`; the others test it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple, fields
from math import nan
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.table import Table as TerminalTable

from annelid.analysis import (
    Detection,
    DetectionScore,
    SlipCost,
    detect_slip,
    precision_recall,
    score_detections,
    slip_cost,
)
from annelid.config import load_config
from annelid.draw import canvas, draw_lines, panel_title, save_both
from annelid.errors import ConfigError
from annelid.experiment import Case, Store
from annelid.markdown import Table
from annelid.output import write_csv
from annelid_studies.tables import terminal_table

PRESET = "riddle2025-muscles"
GAITS = (PRESET, "crawler")
"""Presets of that robot under the paper's network, as published and tuned for speed."""
TUNED_AT = (0.5, 0.85)
"""Frictions at which the feedback was tuned."""
FRICTIONS = (0.3, 0.5, 0.7, 0.85, 1.0, 1.2, 1.5)
QUICK_FRICTIONS = (0.7, 1.0)
DURATION_S = 14.0
"""Long enough for four whole cycles behind the first two contractions of segment 1."""
PLAIN, EXTENSION, PRESSURE = "none", "no pressure", "with pressure"
LOSS_TICKS = (2, 5, 10, 20, 50, 100)
FEEDBACKS = (PLAIN, EXTENSION, PRESSURE)
"""What is fed back beside the paper's stretch sensors: nothing, what of our design needs no touch, all of it."""


class Reading(NamedTuple):
    """One run with one of `FEEDBACKS` on one friction."""

    feedback: str
    friction: float
    cost: SlipCost | None  # Speed and loss; None where there are no whole cycles to judge
    one_wave: bool  # Whether the segments contract in order, in one wave from front to rear


def case(feedback: str, friction: float, preset: str = PRESET) -> Case:
    """Returns the run of one kind of feedback, one of `FEEDBACKS`, on one friction, with one of `GAITS`."""
    changes: dict[str, Any] = {"arena.friction": friction, "duration_s": DURATION_S}
    if feedback != PLAIN:
        changes["controller"] = {"kind": "sns-pressure", "network": load_config(preset).controller.model_dump()}
    if feedback == EXTENSION:
        changes["controller"]["hold"] = 0.0
    return Case(preset, changes)


def slip_feedback(store: Store, frictions: Sequence[float], preset: str = PRESET) -> list[Reading]:
    """Runs the worm with every feedback on every friction, as far as the store does not have it.

    Returns:
        One reading a run, friction by friction.

    Raises:
        ConfigError: The preset is none of `GAITS`.
        AnnelidError: A run cannot be made.
    """
    if preset not in GAITS:
        raise ConfigError(f"preset is {preset!r}: must be one of {', '.join(GAITS)}")
    cases = {(feedback, friction): case(feedback, friction, preset) for friction in frictions for feedback in FEEDBACKS}
    store.compute(cases.values(), "feedback")
    return [Reading(*at, slip_cost(store.run(one)), store[one].rhythm.is_one_wave) for at, one in cases.items()]


def percent(value: float, of: float) -> float:
    """By how much a value is above another one, in percent of that."""
    return 100.0 * (value / of - 1.0)


def compared(readings: Sequence[Reading], reading: Reading) -> tuple[float, float, float] | None:
    """Compares a reading with that without feedback on the same friction.

    Returns:
        Speed gained, loss saved over time, and loss saved over distance, in percent; None where either has no cycles.
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


def write_readings(readings: Sequence[Reading], path: Path) -> Path:
    """Writes one row a run as CSV with a header, and returns its path."""
    costs, gains = ("period_s", "speed_m_per_s", "loss_W", "loss_J_per_m"), ("faster", "saved_per_s", "saved_per_m")

    def cells(one: Reading) -> list[object]:
        numbers = *(getattr(one.cost, name, nan) for name in costs), *(compared(readings, one) or (nan,) * 3)
        texts = [f"{number:.5g}" for number in numbers]
        return [one.feedback, f"{one.friction:g}", one.cost.cycles if one.cost else 0, *texts, one.one_wave]

    header = ["feedback", "friction", "cycles", *costs, *(f"{gain}_percent" for gain in gains), "one_wave"]
    return write_csv(path, header, map(cells, readings))


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


def feedback_figure(readings: Sequence[Reading], preset: str, stem: Path) -> Path:
    """Draws loss per metre and speed against friction; dotted lines where the preset's feedback was tuned."""
    found = [
        (feedback, [(one.friction, one.cost) for one in readings if one.feedback == feedback and one.cost is not None])
        for feedback in FEEDBACKS
    ]
    lines = {feedback: own for feedback, own in found if own}
    tuned_at = TUNED_AT if preset == PRESET else ()
    with canvas(3.0) as figure:
        cost, pace = figure.subplots(1, 2)
        for axes, scale, name in ((cost, 1.0, "loss_J_per_m"), (pace, 100.0, "speed_m_per_s")):
            axes.set_xlabel("friction of the floor" + (" (dotted: tuned here)" if tuned_at else ""))
            for friction in tuned_at:
                axes.axvline(friction, color="0.35", linewidth=0.8, linestyle=":")
            numbers = {
                feedback: ([friction for friction, _ in own], [scale * getattr(each, name) for _, each in own])
                for feedback, own in lines.items()
            }
            draw_lines(axes, numbers, markersize=4)
        panel_title(cost, "What slip costs")
        cost.set(ylabel="work lost to friction (J/m)", yscale="log")
        cost.set_yticks(LOSS_TICKS, [f"{loss}" for loss in LOSS_TICKS])
        cost.minorticks_off()
        cost.legend(title="feedback")
        panel_title(pace, "How fast it is")
        pace.set_ylabel("speed (cm/s)")
        pace.set_ylim(bottom=0.0)
        return save_both(figure, stem)


LIMIT_M_PER_S = 0.1
"""The detector's own limit."""
LIMITS_M_PER_S = np.geomspace(0.005, 1.0, 60)
TIMED = {
    "controller": {"kind": "timed", "rise_s": 0.1, "hold_s": 0.5, "fall_s": 0.1, "interval_s": 0.38},
    "arena.friction": 0.7,
    "duration_s": DURATION_S,
}
CHOSEN_ON = "sns, friction 0.7"
CASES: dict[str, Case] = {
    CHOSEN_ON: case(PLAIN, 0.7),
    "sns, friction 0.3": case(PLAIN, 0.3),
    "sns, friction 1.5": case(PLAIN, 1.5),
    "sns-pressure, friction 0.3": case(PRESSURE, 0.3),
    "sns-pressure, friction 1": case(PRESSURE, 1.0),
    "timed wave, friction 0.7": Case(PRESET, TIMED),
}
"""The runs that the detector reads, by what tables and figures call them."""
QUICK_CASES = (CHOSEN_ON, "sns-pressure, friction 1")


def slip_detection(store: Store, names: Sequence[str] = tuple(CASES)) -> dict[str, Detection]:
    """Runs the worms of some of `CASES`, as far as the store does not have them, and lets the detector read each.

    Raises:
        AnnelidError: A run cannot be made.
    """
    store.compute([CASES[name] for name in names], "detector")
    return {name: detect_slip(store.run(CASES[name])) for name in names}


def scores(detections: Mapping[str, Detection]) -> dict[str, DetectionScore]:
    """Scores every run at the detector's own limit, and all of them but the one that it was chosen on together."""
    each = {name: score_detections([one], LIMIT_M_PER_S) for name, one in detections.items()}
    unseen = [one for name, one in detections.items() if name != CHOSEN_ON]
    return each | ({"all but the first": score_detections(unseen, LIMIT_M_PER_S)} if unseen else {})


def write_scores(found: Mapping[str, DetectionScore], path: Path) -> Path:
    """Writes one row a run as CSV with a header, and returns its path."""
    rows = ([name, *(f"{number:.5g}" for number in astuple(one))] for name, one in found.items())
    return write_csv(path, ["run", *(field.name for field in fields(DetectionScore))], rows)


def detection_table(found: Mapping[str, DetectionScore]) -> TerminalTable:
    """Tabulates the scores."""
    header = ["run", "precision", "recall", "blind", "found", "episodes", "delay (ms)", "false (1/s)", "correlation"]
    rows = []
    for name, one in found.items():
        shares = [f"{share:.2f}" for share in (one.precision, one.recall, one.base_rate, one.found)]
        others = [f"{one.episodes}", f"{1e3 * one.delay_s:.0f}", f"{one.false_alarms_per_s:.1f}"]
        rows.append([name, *shares, *others, f"{one.correlation:.2f}"])
    return terminal_table(Table(header, rows), f"slip reported above {100 * LIMIT_M_PER_S:g} cm/s")


def detector_figure(detections: Mapping[str, Detection], stem: Path) -> Path:
    """Draws precision against recall of every run over `LIMITS_M_PER_S`, and of all at the detector's own limit."""
    together = score_detections(list(detections.values()), LIMIT_M_PER_S)
    with canvas(3.6) as figure:
        axes = figure.subplots()
        curves = {name: precision_recall([one], LIMITS_M_PER_S) for name, one in detections.items()}
        draw_lines(axes, curves, markers=False, linewidth=1.1)
        chosen: dict[str, Any] = {"marker": "o", "markersize": 7, "color": "black", "linestyle": "none"}
        axes.plot(together.recall, together.precision, label="all runs, as it is set", **chosen)
        axes.set(xlim=(0.0, 1.0), ylim=(0.0, 1.02), xlabel="recall", ylabel="precision")
        axes.legend(loc="lower left")
        return save_both(figure, stem)
