"""A sweep that is done: its runs, and all of them as one labelled dataset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from annelid.config import field_paths, unit_of
from annelid.experiment.store import Done
from annelid.experiment.sweep.design import REPEAT, SAMPLE, Plan, label
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
class Sweep:
    """All runs of a study.

    Attributes:
        plan: The design.
        numbers: What is told of every run.
        runs: What became of the plan's points, in their order.
        folder: Folder of the results.
    """

    plan: Plan
    numbers: tuple[Number, ...]
    runs: tuple[Done, ...]
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
    per_segment = [number for number in sweep.numbers if number.per_segment]
    outcomes = [run.outcome for run in sweep.runs if run.outcome is not None]
    n_segments = max((len(number.read(of) or ()) for number in per_segment for of in outcomes), default=0)
    for number in sweep.numbers:
        more = ((SEGMENT, n_segments),) if number.per_segment else ()
        values = _values(number, sweep.runs, n_segments if number.per_segment else 1)
        shape = (*plan.shape, *(length for _, length in more))
        told = {"units": number.unit, "long_name": number.text}
        variables[number.name] = ((*dims, *(dim for dim, _ in more)), values.reshape(shape), told)
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


def _texts(runs: Sequence[Done]) -> dict[str, list[str]]:
    return {
        "status": [run.status for run in runs],
        "reason": [run.reason for run in runs],
        "run": ["" if run.outcome is None else run.outcome.path.name for run in runs],
        "rhythm": ["" if run.outcome is None else run.outcome.rhythm.verdict or "" for run in runs],
        "warnings": ["\n".join(run.warnings) for run in runs],
    }


def _values(number: Number, runs: Sequence[Done], length: int) -> np.ndarray:
    """Reads a number of every run, ``(n_runs, length)``; NaN where it cannot be told."""
    values = np.full((len(runs), length), np.nan)
    for row, run in zip(values, runs, strict=True):
        told = None if run.outcome is None else number.read(run.outcome)
        if told is not None:
            several = np.atleast_1d(np.array(told, dtype=float))
            row[: len(several)] = several
    return values
