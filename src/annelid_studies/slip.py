"""Slip: what pressure feedback saves of its cost, and how well a robot can detect it from stretch and pressure.

The same six-segment worm crawls on several frictions by the paper's network, by that with pressure feedback, and by a
wave by the clock, which senses nothing. Feedback and wave were tuned with one budget on the friction `TUNED_AT`; every
other friction is a test. The detector's constants were chosen on one run, `CHOSEN_ON`; the others test it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple, fields
from math import inf, nan
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.table import Table as TerminalTable

from annelid.analysis import Estimate, forward_position, gait, mean_and_interval
from annelid.config import load_config
from annelid.draw import canvas, draw_lines, panel_title, save_both
from annelid.experiment import Case, Store, finer_steps
from annelid.markdown import Table
from annelid.output import write_csv
from annelid.simulation import Run
from annelid_studies.slip_detector import Detection, DetectionScore, detect_slip, precision_recall, score_detections
from annelid_studies.standard_cases import Effort, drawn_frictions
from annelid_studies.tables import Results, terminal_table

PRESET = "riddle2025-muscles"
TUNED_AT = 0.7
"""Friction at which feedback and timed wave were tuned."""
FRICTIONS: Mapping[Effort, tuple[float, ...]] = {"full": (0.3, 0.7, 1.0), "quick": (0.7, 1.0)}
DRAWS: Mapping[Effort, int] = {"full": 8, "quick": 2}
HALF_STEP_DRAWS = 4
DURATION_S = 14.0
"""Long enough for four whole cycles behind the first two contractions of segment 1."""
PLAIN, EXTENSION, PRESSURE, TIMED = "paper's network", "feedback, no pressure", "pressure feedback", "timed wave"


def _feedback(hold: float) -> dict[str, Any]:
    network = {"kind": "sns", "gate_start": "toolbox", "gate_time_constant_ms": 344.0}
    strengths = {"hold": hold, "release": 5.318, "exchange": 0.05207}
    return {"controller": {"kind": "sns-pressure", "network": network, **strengths}, "sensor.tolerance_m": 0.003332}


CONTROLLERS: Mapping[str, Mapping[str, Any]] = {
    PLAIN: {},
    EXTENSION: _feedback(0.0),
    PRESSURE: _feedback(1.02),
    TIMED: {
        "controller": {"kind": "timed", "rise_s": 0.04079, "hold_s": 0.2104, "fall_s": 0.1913, "interval_s": 0.1137}
    },
}
"""What drives the worm: the preset's controller, feedback with and without what needs touch, and the baseline."""


class Reading(NamedTuple):
    """One controller on one friction: means over draws, with 95 % intervals."""

    friction: float
    controller: str
    in_order: int  # Runs whose segments contract in one wave from front to rear
    draws: int
    speed_m_per_s: Estimate
    loss_J_per_m: Estimate
    faster: Estimate  # Than the timed wave on the same draws, as a share of its speed
    saved: Estimate  # Of the timed wave's loss per metre on the same draws, as a share


def case(controller: str, friction: float, **changes: Any) -> Case:
    """Returns the run by one of `CONTROLLERS` on one friction."""
    own = {**CONTROLLERS[controller], "arena.friction": friction, "duration_s": DURATION_S}
    return Case(PRESET, {**own, **changes})


def feedback(store: Store, output: Path, effort: Effort, half_step: bool = False) -> Results:
    """The study `slip`."""
    steps = finer_steps(load_config(PRESET))[0] if half_step else {}
    draws = min(DRAWS[effort], HALF_STEP_DRAWS) if half_step else DRAWS[effort]
    cases = {
        (friction, controller): [
            case(controller, friction, **steps, **drawn) for drawn in drawn_frictions(friction, draws)
        ]
        for friction in FRICTIONS[effort]
        for controller in CONTROLLERS
    }
    store.compute([one for own in cases.values() for one in own], "feedback")
    numbers = {at: np.array([speed_and_loss(store.run(one)) for one in own]) for at, own in cases.items()}
    readings = []
    for at, own in cases.items():
        speed, loss = numbers[at].T
        timed_speed, timed_loss = numbers[at[0], TIMED].T
        estimates = (speed, loss, speed / timed_speed - 1.0, 1.0 - loss / timed_loss)
        in_order = sum(store[one].rhythm.is_one_wave for one in own)
        readings.append(Reading(*at, in_order, len(own), *(mean_and_interval(each.tolist()) for each in estimates)))
    path = write_readings(readings, output / "slip.csv")
    return (path, feedback_figure(readings, path.with_suffix(""))), [feedback_table(readings)]


def speed_and_loss(run: Run) -> tuple[float, float]:
    """Returns the speed along the initial heading, m/s, and what was lost to friction on the way, J/m.

    Over complete cycles behind the first contraction of segment 1; NaN without any, and an infinite loss for a worm
    that got nowhere or backwards.
    """
    cycles = gait(run)
    if cycles.start_s is None or cycles.end_s is None:
        return nan, nan
    time, loss = run.data["time"].values, run.data["slip_loss"].values.sum(axis=1)
    ends = np.searchsorted(time, [cycles.start_s, cycles.end_s])
    duration, travel, lost = (float(np.diff(each[ends])[0]) for each in (time, forward_position(run), loss))
    return travel / duration, lost / travel if travel > 0.0 else inf


def write_readings(readings: Sequence[Reading], path: Path) -> Path:
    """Writes one row a reading as CSV with a header, and returns its path; intervals as two columns more."""
    estimates = Reading._fields[4:]
    header = [*Reading._fields[:4], *(f"{name}{end}" for name in estimates for end in ("", "_low", "_high"))]
    rows = ([*one[:4], *(f"{number:.5g}" for each in one[4:] for number in each)] for one in readings)
    return write_csv(path, header, rows)


def feedback_table(readings: Sequence[Reading]) -> TerminalTable:
    """Tabulates speed and loss, and the loss saved against the timed wave on the same draws."""
    rows = []
    for one in readings:
        (saved, low, high), faster = one.saved, one.faster[0]
        compared = [""] * 2 if one.controller == TIMED else [f"{100 * faster:+.0f}", _percent(saved, low, high)]
        friction = f"{one.friction:g}{'*' if one.friction == TUNED_AT else ''}"
        numbers = [f"{one.in_order} of {one.draws}", f"{100 * one.speed_m_per_s[0]:.1f}", f"{one.loss_J_per_m[0]:.2f}"]
        rows.append([friction, one.controller, *numbers, *compared])
    header = ["friction", "controller", "in order", "cm/s", "J/m", "faster (%)", "saved per m (%)"]
    caption = "* tuned here; faster and saved: than the timed wave, 95 % interval"
    return terminal_table(Table(header, rows), f"slip of {PRESET}, over complete cycles", n_words=2, caption=caption)


def _percent(mean: float, low: float, high: float) -> str:
    return f"{100 * mean:+.0f} ({100 * low:+.0f} .. {100 * high:+.0f})"


def feedback_figure(readings: Sequence[Reading], stem: Path) -> Path:
    """Draws loss per metre and speed against friction; dotted where controllers were tuned."""
    with canvas(3.0) as figure:
        cost, pace = figure.subplots(1, 2)
        for axes, scale, name in ((cost, 1.0, "loss_J_per_m"), (pace, 100.0, "speed_m_per_s")):
            axes.set_xlabel("friction of the floor (dotted: tuned here)")
            axes.axvline(TUNED_AT, color="0.35", linewidth=0.8, linestyle=":")
            numbers = {}
            for controller in CONTROLLERS:
                own = [one for one in readings if one.controller == controller]
                numbers[controller] = [one.friction for one in own], [scale * getattr(one, name)[0] for one in own]
            draw_lines(axes, numbers, markersize=4)
            axes.set_ylim(bottom=0.0)
        panel_title(cost, "What slip costs")
        cost.set_ylabel("work lost to friction (J/m)")
        cost.legend()
        panel_title(pace, "How fast it is")
        pace.set_ylabel("speed (cm/s)")
        return save_both(figure, stem)


LIMIT_M_PER_S = 0.1
"""The detector's own limit."""
LIMITS_M_PER_S = np.geomspace(0.005, 1.0, 60)
CHOSEN_ON = "sns, friction 0.7"
CASES: dict[str, Case] = {
    CHOSEN_ON: case(PLAIN, 0.7),
    "sns, friction 0.3": case(PLAIN, 0.3),
    "sns, friction 1.5": case(PLAIN, 1.5),
    "sns-pressure, friction 0.3": case(PRESSURE, 0.3),
    "sns-pressure, friction 1": case(PRESSURE, 1.0),
    "timed wave, friction 0.7": case(TIMED, 0.7),
}
"""The runs that the detector reads, by what tables and figures call them."""
QUICK_CASES = (CHOSEN_ON, "sns-pressure, friction 1")


def detection(store: Store, output: Path, effort: Effort) -> Results:
    """The study `slip-detector`, of every run, and of all together but the one that it was chosen on."""
    names = QUICK_CASES if effort == "quick" else tuple(CASES)
    store.compute([CASES[name] for name in names], "detector")
    found = {name: detect_slip(store.run(CASES[name])) for name in names}
    scored = {name: score_detections([one], LIMIT_M_PER_S) for name, one in found.items()}
    unseen = [one for name, one in found.items() if name != CHOSEN_ON]
    scored["all but the first"] = score_detections(unseen, LIMIT_M_PER_S)
    path = write_scores(scored, output / "slip_detector.csv")
    return (path, detector_figure(found, path.with_suffix(""))), [detection_table(scored)]


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
        found = {name: precision_recall([one], LIMITS_M_PER_S) for name, one in detections.items()}
        # Where nothing is reported there is no precision.
        curves = {name: (recall[known := np.isfinite(of)], of[known]) for name, (recall, of) in found.items()}
        draw_lines(axes, curves, marker="", linewidth=1.1)
        chosen: dict[str, Any] = {"marker": "o", "markersize": 7, "color": "black", "linestyle": "none"}
        axes.plot(together.recall, together.precision, label="all runs, default threshold", **chosen)
        axes.set(xlim=(0.0, 1.0), ylim=(0.0, 1.02), xlabel="recall", ylabel="precision")
        axes.legend(loc="lower left")
        return save_both(figure, stem)
