"""How well a robot can tell from stretch and pressure that it slips, over gaits and frictions.

The detector's constants were chosen on one run, `CHOSEN_ON`; the others test it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from annelid.analysis import Detection, DetectionScore, detect_slip, precision_recall, score_detections
from annelid.draw import canvas, draw_lines, save_both
from annelid.experiment import Case, Store, StudyProgress, in_stage
from annelid.output import write_csv
from annelid_studies.slip.feedback import DURATION_S, PLAIN, PRESET, PRESSURE, case
from annelid_studies.tables import tabulated, terminal_table

if TYPE_CHECKING:
    from rich.table import Table as TerminalTable

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
QUICK = (CHOSEN_ON, "sns-pressure, friction 1")


def slip_detection(
    store: Store, names: Sequence[str] | None = None, *, jobs: int | None = None, progress: StudyProgress | None = None
) -> dict[str, Detection]:
    """Runs the worms, as far as the store does not have them, and lets the detector read each.

    Args:
        store: Where runs are kept.
        names: Which of `CASES`; default: all.
        jobs: Runs at a time, by default as many as there are cores.
        progress: Called at the start and after every run.

    Raises:
        AnnelidError: A run cannot be made.
        KeyboardInterrupt: Finished runs are kept.
    """
    cases = {name: CASES[name] for name in names or CASES}
    store.compute(cases.values(), jobs=jobs, progress=in_stage(progress, "detector"))
    return {name: detect_slip(store.run(one)) for name, one in cases.items()}


def scores(detections: Mapping[str, Detection]) -> dict[str, DetectionScore]:
    """Scores every run at the detector's own limit, and all of them but the one that it was chosen on together."""
    each = {name: score_detections([one], LIMIT_M_PER_S) for name, one in detections.items()}
    unseen = [one for name, one in detections.items() if name != CHOSEN_ON]
    return each | ({"all but the first": score_detections(unseen, LIMIT_M_PER_S)} if unseen else {})


def write_scores(told: Mapping[str, DetectionScore], path: Path) -> None:
    """Writes one row a run as CSV with a header.

    Raises:
        RunFileError: The file cannot be written.
    """
    rows = ([name, *(f"{number:.5g}" for number in astuple(one))] for name, one in told.items())
    write_csv(path, ["run", *(field.name for field in fields(DetectionScore))], rows)


def detection_table(told: Mapping[str, DetectionScore]) -> TerminalTable:
    """Tabulates the scores."""
    columns: Mapping[str, Callable[[tuple[str, DetectionScore]], str]] = {
        "run": lambda row: row[0],
        "precision": lambda row: f"{row[1].precision:.2f}",
        "recall": lambda row: f"{row[1].recall:.2f}",
        "blind": lambda row: f"{row[1].base_rate:.2f}",
        "found": lambda row: f"{row[1].found:.2f}",
        "episodes": lambda row: f"{row[1].episodes}",
        "delay (ms)": lambda row: f"{1e3 * row[1].delay_s:.0f}",
        "false (1/s)": lambda row: f"{row[1].false_alarms_per_s:.1f}",
        "correlation": lambda row: f"{row[1].correlation:.2f}",
    }
    return terminal_table(tabulated(told.items(), columns), f"slip told above {100 * LIMIT_M_PER_S:g} cm/s")


def detector_figure(detections: Mapping[str, Detection], stem: str | Path) -> Path:
    """Draws precision against recall of every run over `LIMITS_M_PER_S`, and of all at the detector's own limit.

    Args:
        detections: What the detector said, by the name of the run.
        stem: Path without suffix; ``.svg`` and ``.png`` are written.

    Returns:
        The path of the picture in pixels.

    Raises:
        RunFileError: A file cannot be written.
    """
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
