"""A walk: the log of a robot beside the run of a worm.

Lag, and the clock and the offsets that the map frees, are where the run lies nearest to the whole log (least squares).
Points are means over ranges of time, of log and run alike at the instants of the log.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from annelid.config import Line, NonNegative, RunConfig
from annelid.errors import ConfigError
from annelid.protocols import Array
from annelid_lab.calibration.base import FEWEST, Data, Experiment, Found, file_beside, noise_of_neighbours
from annelid_lab.logs import Measured, read_map, read_measured

ALIKE = 4.0
"""Signals of one unit are compared in it while their standard deviations differ by less; else as shares of these."""
MOST_DRIFT = 0.05
"""Largest drift of the log's clock that is looked for."""
FEWEST_CYCLES = 2.0
"""Cycles that a log should have."""
GAP = 0.5
"""Longest gap of a log, in cycles, that is not named."""
LAGS, DRIFTS = 300, 41
"""Lags and drifts that are looked at before the best is refined."""


@dataclass(frozen=True)
class WalkTest:
    """Lets the worm walk and reads signals of its run."""

    signals: tuple[str, ...]

    def run(self, config: RunConfig) -> Found:
        """Gives times, values and unit of every signal."""
        from annelid.simulation import simulate
        from annelid_lab.logs.agreement import run_series

        found: dict[str, Array] = {}
        with tempfile.TemporaryDirectory(prefix="annelid-") as folder:
            run = simulate(config, folder, progress=False, overwrite=True)
            if run.status == "interrupted":
                raise KeyboardInterrupt
            for number, signal in enumerate(self.signals):
                time_s, values, unit = run_series(run, signal)
                found |= {f"time_{number}": time_s, f"value_{number}": values, f"unit_{number}": np.array(unit)}
        return found


@dataclass(frozen=True)
class Samples:
    """Samples of a log, and of which point each is a part.

    Attributes:
        log: The log.
        at: Instants of each signal, s after the log's first, ``(k,)`` each.
        point: Number of the point of each, ``(k,)`` each.
        scale: What the values of each signal are divided by.
    """

    log: Measured
    at: list[Array]
    point: list[np.ndarray]
    scale: Array

    def means(self, signal: int, values: Array) -> Array:
        """Means of a signal's samples, ``(k,)``, over its points."""
        return np.bincount(self.point[signal], values) / np.bincount(self.point[signal])


class Walk(Experiment):
    """Signals of a log over time."""

    kind: Literal["walk"] = "walk"
    map: Line = Field(description="map of the log's columns, a TOML file, beside the study or below it")
    from_s: NonNegative = Field(default=0.0, description="time of the run before which nothing is compared, s")
    points: Annotated[int, Field(ge=8, le=400)] = Field(default=60, description="points of each signal, means between")

    def read(self, folder: Path) -> Data:
        """Reads the signals of the log."""
        log_map = read_map(file_beside(folder, self.map, f"experiments.{self.name}.map"))
        path = file_beside(folder, self.data, f"experiments.{self.name}.data")
        log = read_measured(path, log_map)
        at: list[Array] = []
        for name, series in log.values.items():
            there = np.isfinite(series)
            if there.sum() < FEWEST or np.ptp(series[there]) == 0.0:
                raise ConfigError(f"column {name!r} of {path} never changes: nothing can be fitted to it")
            at.append(log.time_s[there] - log.time_s[0])
        edges = np.linspace(0.0, np.ptp(log.time_s), self.points + 1)[1:-1]
        point = [np.unique(np.digitize(one, edges), return_inverse=True)[1] for one in at]
        spread: Array = np.array([float(np.nanstd(series)) for series in log.values.values()])
        units = {unit if log.columns[name].scale is None else "" for name, unit in log.kinds.items()}
        one_unit = len(units) == 1 and "" not in units and spread.max() < ALIKE * spread.min()
        samples = Samples(log, at, point, np.ones(len(at)) if one_unit else spread)
        values = [series[np.isfinite(series)] / samples.scale[i] for i, series in enumerate(log.values.values())]
        of = [np.concatenate([samples.means(i, one) for i, one in enumerate(many)]) for many in (at, values)]
        which = np.repeat(np.arange(len(at)), [one.max() + 1 for one in point])
        unit = units.pop() if one_unit else "of its standard deviation"
        label = f"signals ({unit})" if one_unit else "signals over their standard deviations"
        return Data(of[0], of[1], which, ("time of the log (s)", label), unit, log.notes, samples)

    def place(self, data: Data) -> Array:
        """Share of the log's time, so that the last cycles of all signals can be held out."""
        return data.at / float(np.ptp(data.source.log.time_s))

    def test(self, config: RunConfig, data: Data) -> WalkTest:
        """Returns the run to make, with the signals of the map."""
        log: Measured = data.source.log
        if np.ptp(log.time_s) > config.duration_s - self.from_s:
            raise ConfigError(
                f"the log of experiments.{self.name} has {np.ptp(log.time_s):.3g} s, the run {config.duration_s:g} s "
                f"from {self.from_s:g} s on: raise duration_s in the study's table [set], or cut the log"
            )
        return WalkTest(tuple(column.signal for column in log.columns.values()))

    def predicted(self, config: RunConfig, data: Data, found: Found) -> Array:
        """Returns the run's signals at the points."""
        return self._shifted(data, found, *self.alignment(data, found))

    def refuse_unlike(self, data: Data, found: Found, predicted: Array) -> None:
        """Refuses columns in another unit than their signals', or off them by orders of magnitude."""
        from annelid_lab.logs.agreement import refuse_unlike

        for i, name in enumerate(data.source.log.columns):
            refuse_unlike(name, data.source.log, found[f"value_{i}"], str(found[f"unit_{i}"]))

    def numbers(self, data: Data, found: Found) -> dict[str, float]:
        """Returns lag and drift of the clock."""
        lag, drift = self.alignment(data, found)
        return {"lag_s": lag - float(data.source.log.time_s[0]), "clock_drift": drift}

    def noise_floor(self, data: Data) -> Array | None:
        """Standard deviation of the noise of each point, from how far samples lie from the line of their neighbours."""
        if self.noise_sd is not None:
            return super().noise_floor(data)
        source, floor = data.source, list[Array]()
        for i, series in enumerate(source.log.values.values()):
            floor.append(noise_of_neighbours(series) / source.scale[i] / np.sqrt(np.bincount(source.point[i])))
        return np.concatenate(floor)

    def doubts(self, data: Data, found: Found) -> list[str]:
        """Says whether the log is long and whole enough."""
        from annelid_lab.logs.agreement import period

        source, time_s = data.source, found["time_0"]
        span_s = float(np.ptp(source.log.time_s))
        values = np.stack([np.interp(time_s, found[f"time_{i}"], found[f"value_{i}"]) for i in range(len(source.at))])
        cycle_s = period(values) * float(time_s[1] - time_s[0])
        if not np.isfinite(cycle_s):
            return [f"no period is found in the {time_s[-1]:.3g} s of the run: let it and the log last several cycles"]
        sentences: list[str] = []
        if span_s < FEWEST_CYCLES * cycle_s:
            sentences.append(
                f"the log has {span_s / cycle_s:.1f} cycles of {cycle_s:.2g} s: what repeats cannot be told from what "
                f"happened once; log at least {FEWEST_CYCLES:g}"
            )
        logged = np.unique(np.concatenate(source.at))
        longest = int(np.diff(logged).argmax())
        if (gap_s := float(np.diff(logged)[longest])) > GAP * cycle_s:
            sentences.append(
                f"nothing was logged for {gap_s:.2g} s after {logged[longest]:.3g} s: if the clock stopped there, all "
                "that follows is compared too early; log without a gap, or cut the log there"
            )
        return sentences

    def alignment(self, data: Data, found: Found) -> tuple[float, float]:
        """Time of the run at the log's first instant, s, and drift of the log's clock, where both lie nearest."""
        from scipy.optimize import least_squares

        source: Samples = data.source
        log_map, first, time_s = source.log.log_map, float(source.log.time_s[0]), found["time_0"]
        latest = max(float(time_s[-1] - np.ptp(source.log.time_s)), self.from_s)
        n = max(min(round((latest - self.from_s) / float(time_s[1] - time_s[0])) + 1, LAGS), 2)
        lags, drifts = np.linspace(self.from_s, latest, n), np.linspace(-MOST_DRIFT, MOST_DRIFT, DRIFTS)
        if log_map.lag_s != "free":
            lags = np.array([float(log_map.lag_s) + first])
        if log_map.clock_drift != "free":
            drifts = np.array([float(log_map.clock_drift)])
        ways = [(lag, drift) for drift in drifts for lag in lags]
        free = [axis for axis, values in enumerate((lags, drifts)) if len(values) > 1]
        held = self.held(data)
        # Of a walk that is held out, lag and clock are still those of its own log.
        kept = ~held | held.all()

        def misfit(way: tuple[float, float]) -> float:
            return float(((self._coarse(data, found, *way) - data.values)[kept] ** 2).sum())

        # Phases first: the whole range is searched before anything is refined.
        best = np.array(min(ways, key=misfit))
        if not free:
            return float(best[0]), float(best[1])
        size = np.array(
            [lags[1] - lags[0] if len(lags) > 1 else 1.0, drifts[1] - drifts[0] if len(drifts) > 1 else 1.0]
        )

        def off(moved: Array) -> Array:
            here = best.copy()
            here[free] += moved * size[free]
            return (self._shifted(data, found, *here) - data.values)[kept] / np.std(data.values)

        low, high = np.full(len(free), -1.0), np.full(len(free), 1.0)
        moved = least_squares(off, np.zeros(len(free)), bounds=(low, high), diff_step=0.05, x_scale=1.0).x
        best[free] += moved * size[free]
        return float(best[0]), float(best[1])

    def _coarse(self, data: Data, found: Found, lag: float, drift: float) -> Array:
        """The signals at the middle of each point."""
        at = [data.at[data.series == i] for i in range(len(data.source.at))]
        return self._at(data, found, at, None, lag, drift)

    def _shifted(self, data: Data, found: Found, lag: float, drift: float) -> Array:
        """Means of the signals over each point."""
        return self._at(data, found, data.source.at, data.source, lag, drift)

    def _at(self, data: Data, found: Found, at: list[Array], means: Samples | None, lag: float, drift: float) -> Array:
        parts: list[Array] = []
        for i, column in enumerate(data.source.log.columns.values()):
            here = np.interp(lag + at[i] / (1.0 + drift), found[f"time_{i}"], found[f"value_{i}"])
            here = (here if means is None else means.means(i, here)) / data.source.scale[i]
            if column.offset == "free":
                here = here + (data.values[data.series == i] - here).mean()
            parts.append(here)
        return np.concatenate(parts)
