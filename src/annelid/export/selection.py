"""The part of a run that is wanted: some of its signals, from one time to another, every so many samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from annelid.errors import RunFileError, suggest

if TYPE_CHECKING:
    import xarray as xr

    from annelid.simulation.runfile import Run

CLOCKS = {"time": "time", "frame": "frame_time"}
"""Dimensions that go with time, and the variable that tells it."""


@dataclass(frozen=True, slots=True)
class Selection:
    """What is wanted of a run.

    Attributes:
        signals: Names of signals; None for all.
        every: Keep every so many samples of the signals, and as many frames.
        start_s: From this simulated time on, s; None for the start.
        stop_s: Up to this time and with it, s; None for the end.
    """

    signals: Sequence[str] | None = None
    every: int = 1
    start_s: float | None = None
    stop_s: float | None = None


def signal_names(data: xr.Dataset) -> list[str]:
    """Returns the names of what was recorded, without labels and times."""
    return [str(name) for name in data.variables if name not in data.dims and name not in CLOCKS.values()]


def selected(run: Run, selection: Selection) -> Run:
    """Returns a run cut down to a selection; labels and times stay with what they belong to.

    Raises:
        RunFileError: No signal has such a name, or the run holds no sample in that time.
    """
    data = run.data
    for name in selection.signals or ():
        if name not in signal_names(data):
            raise RunFileError(f"the run has no signal {name!r}: {suggest(name, signal_names(data))}")
    if selection.every < 1:
        raise RunFileError(f"every = {selection.every}: keep every sample (1), or every so many")
    for dim, clock in CLOCKS.items():
        data = data.isel({dim: _kept(data[clock].values, selection)})
    if not data.sizes["time"]:
        raise RunFileError(_nothing(run, selection))
    if selection.signals is not None:
        data = data[[*dict.fromkeys(selection.signals), "frame_time"]]
    return replace(run, data=data)


def _kept(times_s: np.ndarray, selection: Selection) -> np.ndarray:
    """Returns the indices of the times that are wanted, to within rounding."""
    start = -np.inf if selection.start_s is None else selection.start_s - 1e-9
    stop = np.inf if selection.stop_s is None else selection.stop_s + 1e-9
    return np.flatnonzero((times_s >= start) & (times_s <= stop))[:: selection.every]


def _nothing(run: Run, selection: Selection) -> str:
    times = run.data["time"].values
    if not times.size:
        return f"{run.path} holds no samples"
    bounds = (("from", selection.start_s), ("to", selection.stop_s))
    asked = " ".join(f"{words} {bound:g} s" for words, bound in bounds if bound is not None)
    return f"{run.path} holds no sample {asked}: it goes from {times[0]:g} to {times[-1]:g} s"
