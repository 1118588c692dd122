"""A sweep that is done: its runs, and all of them as one labelled dataset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from annelid.config import field_paths, unit_of
from annelid.experiment.outcome import Outcome
from annelid.experiment.sweep.design import REPEAT, SAMPLE, Plan, Point, label
from annelid.experiment.sweep.numbers import Number

if TYPE_CHECKING:
    import xarray as xr

SEGMENT = "segment"
_TEXT = {
    "status": "complete, stopped by a guard, or failed",
    "reason": "why a run is not complete",
    "run": "folder of the run",
    "rhythm": "verdict on the rhythm",
    "warnings": "what is doubtful about a run, a sentence a line",
}


@dataclass(frozen=True)
class SweepRun:
    """One run of a sweep, done.

    Attributes:
        point: The run.
        status: "stopped" where a guard ended it before its time, "failed" where it could not be computed.
        reason: Why; empty for a complete run.
        outcome: What is kept of it; None where it failed.
    """

    point: Point
    status: Literal["complete", "stopped", "failed"]
    reason: str
    outcome: Outcome | None

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is doubtful about it, a sentence each."""
        return () if self.outcome is None else self.outcome.summary.warnings


@dataclass(frozen=True)
class Sweep:
    """All runs of a study.

    Attributes:
        plan: The design.
        numbers: What is told of every run.
        runs: The runs, in the order of the plan's points.
        folder: Folder of the results.
    """

    plan: Plan
    numbers: tuple[Number, ...]
    runs: tuple[SweepRun, ...]
    folder: Path


def dataset_of(sweep: Sweep) -> xr.Dataset:
    """Lays out the results of a sweep.

    Returns:
        Along every varied field of a grid, by dotted path, or along ``sample``; ``repeat`` has the seeds of repeats and
        ``segment`` counts from 1. What cannot be told of a run is NaN. Every variable has ``units`` and ``long_name``.
    """
    import xarray as xr

    import annelid

    plan = sweep.plan
    dims = tuple(plan.levels)
    variables: dict[str, Any] = {
        name: (dims, np.array(texts, dtype=object).reshape(plan.shape), {"units": "1", "long_name": _TEXT[name]})
        for name, texts in _texts(sweep.runs).items()
    }
    n_segments = max((_length(number, run) for number in sweep.numbers for run in sweep.runs), default=0)
    for number in sweep.numbers:
        told = {"units": number.unit, "long_name": number.text}
        if number.per_segment:
            rows = np.array([_row(number, run, n_segments) for run in sweep.runs])
            variables[number.name] = (*((*dims, SEGMENT), rows.reshape(*plan.shape, n_segments)), told)
        else:
            values = np.array([_value(number, run) for run in sweep.runs])
            variables[number.name] = (dims, values.reshape(plan.shape), told)
    return xr.Dataset(
        variables,
        coords=_coordinates(sweep, n_segments),
        attrs={
            "title": plan.study.name,
            "study": plan.study.model_dump_json(by_alias=True),
            "base_config": plan.base.model_dump_json(),
            "annelid_version": annelid.__version__,
            "n_failed": sum(run.status == "failed" for run in sweep.runs),
            "n_warned": sum(bool(run.warnings) for run in sweep.runs),
        },
    )


def _coordinates(sweep: Sweep, n_segments: int) -> dict[str, Any]:
    plan = sweep.plan
    words = field_paths()
    coords: dict[str, Any] = {}
    for place, field in enumerate(plan.fields):
        told = {"units": unit_of(field) or "1", "long_name": words[field] or field}
        if field in plan.levels:
            coords[field] = (field, column(plan.levels[field]), told)
        else:
            coords[field] = (SAMPLE, column([sample[place] for sample in plan.samples]), told)
    for name, text in ((SAMPLE, "number of the sample"), (REPEAT, "seed of the run")):
        if name in plan.levels:
            coords[name] = (name, np.array(plan.levels[name]), {"units": "1", "long_name": text})
    if any(number.per_segment for number in sweep.numbers):
        told = {"units": "1", "long_name": "segment, from the front"}
        coords[SEGMENT] = (SEGMENT, np.arange(1, n_segments + 1), told)
    return coords


def column(values: Sequence[Any]) -> np.ndarray:
    """Returns values of a field as numbers where all are, else as words."""
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return np.array(values)
    return np.array([label(value) for value in values], dtype=object)


def _texts(runs: Sequence[SweepRun]) -> dict[str, list[str]]:
    return {
        "status": [run.status for run in runs],
        "reason": [run.reason for run in runs],
        "run": ["" if run.outcome is None else run.outcome.path.name for run in runs],
        "rhythm": ["" if run.outcome is None else run.outcome.rhythm.verdict or "" for run in runs],
        "warnings": ["\n".join(run.warnings) for run in runs],
    }


def _value(number: Number, run: SweepRun) -> float:
    value = None if run.outcome is None else number.read(run.outcome)
    return np.nan if value is None else float(value)


def _row(number: Number, run: SweepRun, n_segments: int) -> np.ndarray:
    row = np.full(n_segments, np.nan)
    values = None if run.outcome is None else number.read(run.outcome)
    if values is not None:
        row[: len(values)] = [np.nan if value is None else value for value in values]
    return row


def _length(number: Number, run: SweepRun) -> int:
    values = number.read(run.outcome) if number.per_segment and run.outcome is not None else None
    return 0 if values is None else len(values)
