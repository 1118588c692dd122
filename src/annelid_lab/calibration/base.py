"""What every kind of experiment has: its data, what it simulates of a worm, and what it predicts."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from math import nan, sqrt
from pathlib import Path
from typing import Annotated, Any, ClassVar, Protocol

import numpy as np
from pydantic import Field

from annelid.config import Kind, Line, Positive, RunConfig, Share
from annelid.errors import ConfigError
from annelid.protocols import Array
from annelid.registry import Registry
from annelid_lab.logs import Column, LogMap, read_measured

Found = Mapping[str, Array]
"""Arrays that a test of a worm gives, by name."""
FEWEST = 8
"""Points that an experiment must have."""
MOST_HELD = 0.8
"""Share of the points that may be held out of an experiment that is fitted."""
NORMAL_MEDIAN = 0.6745
"""Median of the distance of normal numbers from their mean, in standard deviations."""
OFF_SCALE = 20.0
"""Data that are so many times as large or as small as the worm's have another unit than their columns say."""
UNITS = {"Pa": ((1e9, "GPa"), (1e6, "MPa")), "m": ((1e-3, "mm"),)}
"""Units in which results are shown, the largest that fits, by SI unit."""


class Test(Protocol):
    """What is done to a worm in an experiment: picklable, and its ``repr`` says all that it depends on."""

    def run(self, config: RunConfig) -> Found:
        """Does it to a worm."""
        ...


@dataclass(frozen=True)
class Data:
    """Measured points.

    Attributes:
        at: Where each was measured, such as a time or a displacement, ``(n,)``.
        values: What was measured, ``(n,)``.
        series: Which stretch of points each belongs to, ``(n,)``; errors are correlated within one only.
        labels: What the two are, with their units, for axes.
        unit: Of the values.
        notes: What was handled, a sentence each.
        source: What the experiment itself needs of its data.
    """

    at: Array
    values: Array
    series: np.ndarray
    labels: tuple[str, str]
    unit: str
    notes: tuple[str, ...] = ()
    source: Any = None


class Experiment(Kind):
    """Base of the experiments.

    Attributes:
        name: As residuals, parameters (``experiments.NAME.FIELD``) and tables call it.
    """

    registry: ClassVar[Registry[type[Experiment]]] = Registry("experiments.kind", "annelid_lab.calibration.kinds")
    default: ClassVar[str] = "load-frame"
    name: Annotated[Line, Field(pattern=r"^[A-Za-z][\w-]*$", max_length=40)] = Field(description="name in results")
    data: Line = Field(description="file of the data, beside the study or below it")
    noise_sd: Positive | None = Field(
        default=None, description="standard deviation of the noise of one point, in the values' unit; none: estimated"
    )
    hold_out: tuple[tuple[Share, Share], ...] = Field(
        default=(),
        description="parts of the points, in order from 0 to 1, that are predicted and not fitted; [[0, 1]]: all",
    )
    set: Mapping[str, Any] = Field(
        default_factory=dict, description="fields of the worm that differ in this experiment, as a payload or the floor"
    )

    @abstractmethod
    def read(self, folder: Path) -> Data:
        """Reads the data of the study in a folder.

        Raises:
            ConfigError: They lie elsewhere, or have no such column or another unit.
            UnreadableText: They cannot be read.
        """

    def place(self, data: Data) -> Array:
        """Place of each point in the order of the measurement, from 0 to 1, ``(n,)``."""
        return (np.arange(len(data.at)) + 0.5) / len(data.at)

    def held(self, data: Data) -> np.ndarray:
        """Which points are held out, ``(n,)``.

        Raises:
            ConfigError: Too few are left.
        """
        place = self.place(data)
        held = np.zeros(len(place), dtype=bool)
        for low, high in self.hold_out:
            held |= (place >= low) & ((place < high) | (high == 1.0))
        if not held.all() and held.sum() > MOST_HELD * len(held):
            raise ConfigError(
                f"experiments.{self.name}.hold_out leaves {(~held).sum()} of {len(held)} points to fit: hold out at "
                f"most {100 * MOST_HELD:.0f} % of them, or all of the experiment with [[0, 1]]"
            )
        return held

    def test(self, config: RunConfig, data: Data) -> Test | None:
        """Returns what has to be simulated; None where a closed form predicts the points."""
        return None

    @abstractmethod
    def predicted(self, config: RunConfig, data: Data, found: Found) -> Array:
        """Predicts the points, ``(n,)``, from what the test of the worm gave."""

    def refuse_unlike(self, data: Data, found: Found, predicted: Array) -> None:
        """Refuses data that the worm which a fit starts from misses by orders of magnitude."""
        sizes = [float(np.abs(values).max()) for values in (data.values, predicted)]
        if min(sizes) > 0 and not 1 / OFF_SCALE < sizes[0] / sizes[1] < OFF_SCALE:
            raise ConfigError(
                f"the data of experiments.{self.name} reach {sizes[0]:.3g} {data.unit}, the worm that the fit starts "
                f"from {sizes[1]:.3g} {data.unit}: is a unit wrong?"
            )

    def noise_held_out(self, data: Data) -> float:
        """Standard deviation of a point's noise where no fit estimates it: known, or that of the noisiest series."""
        if (floor := self.noise_floor(data)) is not None:
            return float(np.sqrt((floor**2).mean()))
        return max(noise_of_neighbours(data.values[data.series == one]) for one in np.unique(data.series))

    def numbers(self, data: Data, found: Found) -> dict[str, float]:
        """Returns further numbers of a fit, by name."""
        return {}

    def noise_floor(self, data: Data) -> Array | None:
        """Standard deviation of the noise of each point, ``(n,)``, as far as it is known without a fit."""
        return None if self.noise_sd is None else np.full(len(data.at), self.noise_sd)

    def doubts(self, data: Data, found: Found) -> list[str]:
        """Says what is wrong with the data, a sentence each, and what to measure instead."""
        return []


def noise_of_neighbours(values: Array) -> float:
    """Standard deviation of white noise on values in a row, ``(n,)``, from how far each lies from its neighbours' line.

    A value that is not finite, and what lies beside it, does not count; NaN where nothing is left.
    """
    bend = np.abs(np.diff(values, 2))
    bend = bend[np.isfinite(bend)]
    return float(np.median(bend)) / (NORMAL_MEDIAN * sqrt(6.0)) if len(bend) else nan


def file_beside(folder: Path, given: str, what: str) -> Path:
    """Returns the path of a file that a study names.

    Raises:
        ConfigError: It does not lie beside the study or below it.
    """
    path = folder / given
    if Path(given).is_absolute() or not path.resolve().is_relative_to(folder.resolve()):
        raise ConfigError(f"{what} = {given!r} must lie beside the study or below it: a relative path without '..'")
    return path


def read_columns(path: Path, time: str | None, wanted: Mapping[str, str]) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Reads columns of a table as `read_measured` does, in SI units.

    Args:
        path: The table.
        time: Column of the time, which comes back as ``"time"``; None where there is none.
        wanted: The SI unit that each column must have, by its name.

    Returns:
        The columns, ``(n,)`` each, without rows in which one is missing; and what was handled.
    """
    named = {name: Column(signal=name) for name in wanted}
    log = read_measured(path, LogMap(time=time, rate_Hz=None if time else 1.0, map=named))
    for name, unit in wanted.items():
        if log.kinds[name] != unit:
            raise ConfigError(f"column {name!r} of {path} is in {log.kinds[name]}, not in {unit}")
        if np.nanmin(log.values[name]) == np.nanmax(log.values[name]):
            raise ConfigError(f"column {name!r} of {path} never changes: nothing can be fitted to it")
    whole = np.all([np.isfinite(log.values[name]) for name in wanted], axis=0)
    if whole.sum() < FEWEST:
        raise ConfigError(f"{path} has {whole.sum()} complete rows: at least {FEWEST} are needed")
    return {"time": log.time_s[whole]} | {name: log.values[name][whole] for name in wanted}, log.notes


def binned(at: Array, values: Array, n: int) -> tuple[Array, Array]:
    """Means of points over n even ranges of where they were measured, those without a point left out."""
    from scipy.stats import binned_statistic

    means, _, _ = binned_statistic(at, [at, values], bins=n)
    means = means[:, np.isfinite(means[0])]
    return means[0], means[1]


def shown_in(unit: str, size: float) -> tuple[float, str]:
    """Returns by what values in an SI unit are divided to be shown, and a space and the unit; nothing for "1"."""
    for factor, name in UNITS.get(unit, ()):
        if size >= 0.1 * factor or (factor, name) == UNITS[unit][-1]:
            return factor, f" {name}"
    return 1.0, "" if unit == "1" else f" {unit}"
