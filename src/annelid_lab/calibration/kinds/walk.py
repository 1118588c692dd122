"""A walk: the log of a robot, compared with a run as `annelid compare` does."""

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
from annelid_lab.calibration.base import FEWEST, Data, Experiment, Found, binned, file_beside
from annelid_lab.logs import Measured, read_map, read_measured


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


class Walk(Experiment):
    """Signals of a log over time, each over its own standard deviation."""

    kind: Literal["walk"] = "walk"
    map: Line = Field(description="map of the log's columns, a TOML file, beside the study or below it")
    from_s: NonNegative = Field(default=0.0, description="time of the run before which nothing is compared, s")
    points: Annotated[int, Field(ge=8, le=400)] = Field(default=60, description="points of each signal, means between")

    def read(self, folder: Path) -> Data:
        """Reads the signals of the log."""
        log_map = read_map(file_beside(folder, self.map, f"experiments.{self.name}.map"))
        path = file_beside(folder, self.data, f"experiments.{self.name}.data")
        log = read_measured(path, log_map)
        points: list[tuple[Array, Array]] = []
        for name, series in log.values.items():
            there = np.isfinite(series)
            if there.sum() < FEWEST or np.ptp(series[there]) == 0.0:
                raise ConfigError(f"column {name!r} of {path} never changes: nothing can be fitted to it")
            at, values = binned(log.time_s[there] - log.time_s[0], series[there], self.points)
            points.append((at, values / np.std(series[there])))
        at, values = (np.concatenate([one[part] for one in points]) for part in (0, 1))
        which = np.repeat(np.arange(len(points)), [len(one[0]) for one in points])
        labels = ("time of the log (s)", "signals over their standard deviations")
        return Data(at, values, which, labels, "1", log.notes, log)

    def test(self, config: RunConfig, data: Data) -> WalkTest:
        """Returns the run to make, with the signals of the map."""
        log: Measured = data.source
        if np.ptp(log.time_s) > config.duration_s - self.from_s:
            raise ConfigError(
                f"the log of experiments.{self.name} has {np.ptp(log.time_s):.3g} s, the run {config.duration_s:g} s "
                f"from {self.from_s:g} s on: raise duration_s in the study's table [set], or cut the log"
            )
        return WalkTest(tuple(column.signal for column in log.columns.values()))

    def predicted(self, config: RunConfig, data: Data, found: Found) -> Array:
        """Returns the run's signals at the points; where log and run do not overlap, the points themselves."""
        # It loads much of SciPy, which other experiments do not need.
        from annelid_lab.logs.agreement import compare_series

        log: Measured = data.source
        units = {name: str(found[f"unit_{i}"]) for i, name in enumerate(log.columns)}
        series = {name: (found[f"time_{i}"], found[f"value_{i}"], units[name]) for i, name in enumerate(log.columns)}
        aligned = compare_series(series, log, from_s=self.from_s)
        predicted = data.values.copy()
        for i, (name, column) in enumerate(log.columns.items()):
            mine = data.series == i
            time_s, values, _ = series[name]
            at = log.time_s[0] + aligned.lag_s + data.at[mine] / (1.0 + aligned.clock_drift)
            here = np.interp(at, time_s, values / np.nanstd(log.values[name]), left=np.nan, right=np.nan)
            if column.offset == "free":
                here += np.nanmean(data.values[mine] - here)
            predicted[mine] = np.where(np.isfinite(here), here, predicted[mine])
        return predicted
