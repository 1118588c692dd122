"""How well a run agrees with a measured log: both aligned in time, then errors, phase and duty of each signal."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import correlate, find_peaks
from scipy.stats import binned_statistic

from annelid.analysis import forward_position, track_of
from annelid.body import stretch_sensors, worm_of
from annelid.errors import ConfigError, listed, shown, suggest
from annelid.protocols import Array
from annelid.simulation import Run
from annelid_lab.logs.measured import Measured

FEWEST_SHARED = 20
"""Samples that log and run have at least in common."""
LEAST_OVERLAP = 0.5
"""Share of the shorter of both records that must overlap."""
LONGEST_GAP_SAMPLES = 3.0
"""Gaps of up to so many of the log's usual steps are interpolated; longer ones are left out."""
EQUAL, NEARLY = 1e-5, 0.001
"""Of lags whose correlation is so close to the best one's: the smallest is taken, or another one is named."""
LEAST_PERIODIC = 0.3
"""Smallest autocorrelation one period later of a signal that counts as periodic."""
MOST_SAMPLES = 2_000_000
"""Of either record, as compared."""
OFF_SCALE = 20.0
"""A column that is so many times as large or as small as its signal has another unit than the map says."""
MOST_DRIFT = 0.05
"""Largest drift of the log's clock that is looked for."""
_REFERENCE = re.compile(r"^\s*(\w+)\s*(?:\[([^\[\]]*)\])?\s*$")


@dataclass(frozen=True)
class SignalAgreement:
    """One signal, measured and simulated, over the samples where both are.

    Attributes:
        signal: The signal of the run.
        unit: SI unit of what follows.
        samples: Samples compared.
        rms: Root mean square of simulated minus measured.
        bias: Mean of the same.
        relative: ``rms`` over the measured `amplitude`.
        amplitude: Measured and simulated: from the 2nd to the 98th percentile.
        duty: Measured and simulated: share of the time above the middle between these.
        phase: Simulated minus measured phase of the fundamental, in cycles, -0.5 to 0.5, relative to the first
            signal's, each at its own period; NaN without a period.
        waveform: Correlation of the mean cycles, shifted to where it is greatest; NaN without a period.
    """

    signal: str
    unit: str
    samples: int
    rms: float
    bias: float
    relative: float
    amplitude: tuple[float, float]
    duty: tuple[float, float]
    phase: float
    waveform: float


@dataclass(frozen=True)
class Agreement:
    """A run and a log.

    Attributes:
        lag_s: Time of the run less time of the log at the log's beginning, s.
        clock_drift: How much faster than true the log's clock is taken to run.
        correlation: Mean correlation of all signals as aligned.
        period_s: Measured and simulated period, s; NaN where there is none.
        signals: By the columns' names.
        time_s: Instants compared, in the run's time, s, ``(n,)``.
        measured: Series on these, NaN in gaps, by the columns' names.
        simulated: The same of the run.
        notes: What was handled or is doubtful, a sentence each.
    """

    lag_s: float
    clock_drift: float
    correlation: float
    period_s: tuple[float, float]
    signals: Mapping[str, SignalAgreement]
    time_s: Array
    measured: Mapping[str, Array]
    simulated: Mapping[str, Array]
    notes: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Returns the numbers without the series, ready for JSON; None for what is not a number."""
        whole = {name: getattr(self, name) for name in ("lag_s", "clock_drift", "correlation", "period_s", "notes")}
        return _plain(whole | {"signals": {name: asdict(one) for name, one in self.signals.items()}})


def compare_with_log(run: Run, log: Measured, *, from_s: float = 0.0) -> Agreement:
    """Aligns a log with a run and compares them, signal by signal.

    The lag is where the mean cross-correlation of all signals is greatest, among equally good ones the smallest. A
    clock's drift is fitted only where the map says so: one log cannot distinguish it from another period.

    Args:
        run: The run.
        log: The log.
        from_s: Time of the run before which nothing is compared, s.

    Raises:
        ConfigError: A signal is not in the run, has another unit, or is off by orders of magnitude; or there is too
            little to compare.
    """
    return compare_series({name: run_series(run, one.signal) for name, one in log.columns.items()}, log, from_s=from_s)


def compare_series(series: Mapping[str, tuple[Array, Array, str]], log: Measured, *, from_s: float = 0.0) -> Agreement:
    """Does what `compare_with_log` does, with times, s, values and unit of every column's signal."""
    simulated: dict[str, tuple[Array, Array]] = {}
    units: dict[str, str] = {}
    notes = list(log.notes)
    for name in log.columns:
        time_s, values, units[name] = series[name]
        kept = time_s >= from_s
        simulated[name] = time_s[kept], values[kept]
        refuse_unlike(name, log, values, units[name])
    steps = [float(np.median(np.diff(time_s))) for time_s, _ in simulated.values() if len(time_s) > 1]
    span_s = max((float(np.ptp(time_s)) for time_s, _ in simulated.values() if len(time_s)), default=0.0)
    log_step_s, log_span_s = float(np.median(np.diff(log.time_s))), float(np.ptp(log.time_s))
    step_s = max([*steps, log_step_s / 4])
    if min(span_s, log_span_s) < 20 * step_s:
        raise ConfigError(
            f"too short to compare: the run has {span_s:.3g} s from {from_s:g} s on, the log {log_span_s:.3g} s; "
            "is time_unit of the map right?"
        )
    if max(span_s, log_span_s) > MOST_SAMPLES * step_s:
        raise ConfigError(
            f"too long to compare in steps of {step_s:.3g} s: the run has {span_s:.3g} s, the log {log_span_s:.3g} s; "
            "is a time in it wrong?"
        )
    start_s = max(time_s[0] for time_s, _ in simulated.values())
    end_s = min(time_s[-1] for time_s, _ in simulated.values())
    grid = np.arange(start_s, end_s + 0.5 * step_s, step_s)
    ours = np.stack([np.interp(grid, *pair) for pair in simulated.values()])

    given = log.log_map.clock_drift
    drift = _drift(log, ours, step_s) if given == "free" else given
    theirs = _resampled(log, drift, step_s)
    if log.log_map.lag_s == "free":
        exact, second = _best(*_correlations(theirs, ours))
        if second is not None:
            other_s = grid[0] + second * step_s - log.time_s[0]
            notes.append(f"a lag of {other_s:.3g} s fits nearly as well: lag_s in the map decides")
    else:
        exact = float(log.log_map.lag_s - grid[0] + log.time_s[0]) / step_s
    lag = round(exact)
    theirs = _resampled(log, drift, step_s, (lag - exact) * step_s)
    overlap = slice(max(lag, 0), min(lag + theirs.shape[1], ours.shape[1]))
    of_log = slice(overlap.start - lag, overlap.stop - lag)
    if (shared := max(0, overlap.stop - overlap.start)) < FEWEST_SHARED:
        raise ConfigError(
            f"log and run have {shared} samples of {step_s:.3g} s in common at lag_s = {shown(log.log_map.lag_s)}, and "
            f"at least {FEWEST_SHARED} are compared: let the run be longer, or change lag_s"
        )
    measured, simulated_here, time_s = theirs[:, of_log].copy(), ours[:, overlap], grid[overlap]
    for row, (name, column) in enumerate(log.columns.items()):
        seen = np.isfinite(measured[row])
        if column.offset == "free":
            measured[row] += simulated_here[row, seen].mean() - measured[row, seen].mean()
        if column.signal == "travel" and seen.any() and measured[row, seen][-1] < measured[row, seen][0]:
            notes.append(f"{name} goes backward: if the robot walks to where it falls, write scale = -1 for it")

    periods = (period(theirs) * step_s, period(ours) * step_s)
    ratio = periods[0] / periods[1]
    if np.isfinite(ratio) and abs(ratio - 1.0) > 0.005 and given != "free":
        notes.append(
            f"the measured period is {periods[0]:.4g} s, the simulated one {periods[1]:.4g} s, a difference of "
            f"{100 * (ratio - 1):+.1f} %, so that both run apart. If only the log's clock is wrong, write "
            'clock_drift = "free" in the map'
        )
    rows = dict(zip(log.columns, zip(measured, simulated_here, strict=True), strict=True))
    signals = {}
    for (name, (theirs_here, ours_here)), column in zip(rows.items(), log.columns.values(), strict=True):
        signals[name] = _compared(column.signal, units[name], theirs_here, ours_here, periods, step_s)
    first = next((one.phase for one in signals.values() if np.isfinite(one.phase)), 0.0)
    signals = {name: replace(one, phase=(one.phase - first + 0.5) % 1.0 - 0.5) for name, one in signals.items()}
    if not any(np.isfinite(one.waveform) for one in signals.values()):
        notes.append("no common period was found: phases are not compared")
    known = [one for one in (_correlated(a, b) for a, b in rows.values()) if np.isfinite(one)]
    return Agreement(
        lag_s=float(grid[0] + exact * step_s - log.time_s[0]),
        clock_drift=float(drift),
        correlation=float(np.mean(known)) if known else np.nan,
        period_s=periods,
        signals=signals,
        time_s=time_s,
        measured={name: pair[0] for name, pair in rows.items()},
        simulated={name: pair[1] for name, pair in rows.items()},
        notes=tuple(notes),
    )


def period(signals: Array) -> float:
    """Returns the common period of signals, ``(k, n)``, in samples, by their autocorrelation; NaN without one."""
    n = signals.shape[1]
    there = np.isfinite(signals).astype(float)
    with np.errstate(invalid="ignore", divide="ignore"):
        level = np.where(there > 0, _standardised(signals), 0.0)
        count = _autocorrelation(there)[:, : n // 2 + 1]
        mean = np.nanmean(np.where(count > n / 8, _autocorrelation(level)[:, : n // 2 + 1] / count, np.nan), axis=0)
    peaks, _ = find_peaks(np.nan_to_num(mean), height=LEAST_PERIODIC, prominence=0.1)
    if not peaks.size:
        return np.nan
    best = peaks[np.flatnonzero(mean[peaks] >= 0.8 * mean[peaks].max())[0]]
    return float(best + _vertex(*mean[best - 1 : best + 2]))


def run_series(run: Run, reference: str) -> tuple[Array, Array, str]:
    """Returns times, s, values and unit of a signal of a run.

    Args:
        run: The run.
        reference: A variable with a label for each dimension beside the time, as ``stretch_length[1, left]`` or
            ``muscle_force[ring_0]``: segments from 1, unlabelled dimensions from 0, ``mean`` for the mean over one.
            Besides: ``travel``, and ``ring_distance[1]``, from the centre of ring 1 to that of ring 2 (once a frame).

    Raises:
        ConfigError: The run has no such signal, or a label is none of its dimension's.
    """
    found = _REFERENCE.match(reference)
    name, labels = (found[1], found[2]) if found else (reference, None)
    given = [label.strip() for label in labels.split(",")] if labels else []
    if name == "travel" and "center_of_mass" in run.data and not given:
        ahead = forward_position(run)
        return run.data["time"].values, ahead - ahead[0], "m"
    if name == "ring_distance" and run.config.body.geometry() is not None:
        between = [str(segment) for segment in range(1, run.config.body.n_segments)]
        first = int(_label(given[0] if given else "", between, reference, "pair of rings"))
        track = track_of(run)
        ends = [track.ring_centre(first + i) for i in (-1, 0)]
        return track.time_s, np.linalg.norm(ends[1] - ends[0], axis=1), "m"
    offered = [str(v) for v, own in run.data.data_vars.items() if own.dims[:1] == ("time",)]
    if name not in offered:
        raise ConfigError(
            f"the run has no signal {shown(name)}: {suggest(name, [*offered, 'travel', 'ring_distance'])}"
        )
    signal = run.data[name]
    dimensions = [str(dimension) for dimension in signal.dims[1:]]
    if len(given) != len(dimensions):
        raise ConfigError(f"{shown(reference)} needs a label for each of {listed(dimensions) or 'no dimension'}")
    for dimension, label in zip(dimensions, given, strict=True):
        known = [str(one) for one in signal[dimension].values]
        sides = _sides(run) if dimension == "sensor" else {}
        if _label(label, [*known, *sides, "mean"], reference, dimension) == "mean":
            signal = signal.mean(dimension)
        elif label in sides:
            segment = given[dimensions.index("segment")]
            if segment == "mean":
                raise ConfigError(f"{shown(reference)}: {label} is another sensor in every segment; name a segment")
            signal = signal.isel({dimension: sides[label][int(segment) - 1]})
        else:
            signal = signal.isel({dimension: known.index(label)})
    return run.data["time"].values, signal.values.astype(float), str(run.data[name].attrs["units"])


def _label(given: str, known: list[str], reference: str, what: str) -> str:
    if given not in known:
        raise ConfigError(f"{shown(reference)}: unknown {what} {shown(given)}, it is one of {listed(known)}")
    return given


def _sides(run: Run) -> dict[str, list[int]]:
    """Which sensor of each segment lies to the left, and which to the right."""
    geometry = run.config.body.geometry()
    if geometry is None:
        return {}
    body = worm_of(run.config)
    carried = stretch_sensors(geometry, body.springs)
    sides = stretch_sensors(geometry, body.springs.model_copy(update={"sensors": "sides"}))
    places = (carried[:, :, None] == sides[:, None, :]).argmax(axis=1)
    return {"left": places[:, 0].tolist(), "right": places[:, 1].tolist()}


def refuse_unlike(name: str, log: Measured, values: Array, unit: str) -> None:
    """Refuses a column in another unit than its signal's, or off it by orders of magnitude."""
    column = log.columns[name]
    if column.scale is None and (kind := log.kinds[name]) != unit:
        raise ConfigError(f"{name} is in {kind}, {column.signal} in {unit}: give a scale, the {unit} in one {kind}")
    sizes = [
        float(np.nanmax(np.abs(one - (np.nanmean(one) if column.offset == "free" else 0.0))))
        for one in (log.values[name], values)
    ]
    if min(sizes) > 0 and not 1 / OFF_SCALE < sizes[0] / sizes[1] < OFF_SCALE:
        raise ConfigError(
            f"{name} reaches {sizes[0]:.3g} {unit}, {column.signal} only {sizes[1]:.3g}: is its unit right?"
            if sizes[0] > sizes[1]
            else f"{name} reaches only {sizes[0]:.3g} {unit}, {column.signal} {sizes[1]:.3g}: is its unit right?"
        )


def _resampled(log: Measured, drift: float, step_s: float, from_s: float = 0.0) -> Array:
    """The log's series on an even grid, by its true time since its first instant, NaN in gaps, ``(k, n)``."""
    true_s = (log.time_s - log.time_s[0]) / (1.0 + drift)
    grid = np.arange(from_s, true_s[-1] + 0.5 * step_s, step_s)
    longest = LONGEST_GAP_SAMPLES * float(np.median(np.diff(true_s)))
    rows = []
    for series in log.values.values():
        seen = np.isfinite(series)
        at = true_s[seen]
        row = np.interp(grid, at, series[seen], left=np.nan, right=np.nan)
        behind = np.clip(np.searchsorted(at, grid, side="left"), 1, len(at) - 1)
        row[(at[behind] - at[behind - 1] > longest) & (grid > at[behind - 1]) & (grid < at[behind])] = np.nan
        rows.append(row)
    return np.stack(rows)


def _correlations(theirs: Array, ours: Array) -> tuple[np.ndarray, Array]:
    """Mean correlation of all signals at every lag in samples at which enough overlaps; gaps do not count."""
    n, m = ours.shape[1], theirs.shape[1]
    lags = np.arange(-m + 1, n)
    total = np.zeros(len(lags))
    least = LEAST_OVERLAP * min(n, m)
    enough = np.ones(len(lags), dtype=bool)
    for a, b in zip(theirs, ours, strict=True):
        there = np.isfinite(a).astype(float)
        x, y, one = np.where(there > 0, a - np.nanmean(a), 0.0), b - b.mean(), np.ones(n)
        count = correlate(one, there)
        with np.errstate(invalid="ignore", divide="ignore"):
            sum_x, sum_y = correlate(one, x), correlate(y, there)
            spread_x = correlate(one, x**2) - sum_x**2 / count
            spread_y = correlate(y**2, there) - sum_y**2 / count
            r = (correlate(y, x) - sum_x * sum_y / count) / np.sqrt(np.clip(spread_x * spread_y, 1e-300, None))
        enough &= count > least * there.mean()
        total += np.where(np.isfinite(r) & (np.abs(r) <= 1.001), r, 0.0)
    if not enough.any():
        raise ConfigError("log and run have too little in common to align them")
    return lags[enough], total[enough] / len(theirs)


def _best(lags: np.ndarray, scores: Array) -> tuple[float, float | None]:
    """The best of the lags that are local maxima, between samples, and the next one that is nearly as good."""
    higher = np.maximum(np.append(scores[1:], -np.inf), np.insert(scores[:-1], 0, -np.inf))
    good = np.flatnonzero((scores >= higher) & (scores >= scores.max() - EQUAL))
    best = int(good[np.abs(lags[good]).argmin()])
    inside = 0 < best < len(lags) - 1 and lags[best + 1] - lags[best - 1] == 2
    others = [i for i in np.flatnonzero((scores >= higher) & (scores >= scores.max() - NEARLY)) if i != best]
    second = float(lags[max(others, key=lambda i: scores[i])]) if others else None
    return float(lags[best] + (_vertex(*scores[best - 1 : best + 2]) if inside else 0.0)), second


def _drift(log: Measured, ours: Array, step_s: float) -> float:
    """How much faster than true the log's clock runs: where the best correlation is greatest."""

    def worst(drift: float) -> float:
        return -float(_correlations(_resampled(log, drift, step_s), ours)[1].max())

    coarse = np.linspace(-MOST_DRIFT, MOST_DRIFT, 41)
    best = coarse[int(np.argmin([worst(drift) for drift in coarse]))]
    width = coarse[1] - coarse[0]
    found: Any = minimize_scalar(worst, bounds=(best - width, best + width), method="bounded", options={"xatol": 1e-5})
    return float(found.x)


def _compared(
    signal: str, unit: str, theirs: Array, ours: Array, periods: tuple[float, float], step_s: float
) -> SignalAgreement:
    """Compares one signal; its phase is not yet relative to the first signal's."""
    seen = np.isfinite(theirs)
    off = ours[seen] - theirs[seen]
    rms = float(np.sqrt((off**2).mean())) if off.size else np.nan
    ends = [np.percentile(one[seen], [2, 98]) if off.size else np.full(2, np.nan) for one in (theirs, ours)]
    amplitude = float(np.ptp(ends[0])), float(np.ptp(ends[1]))
    duty = float((theirs[seen] > ends[0].mean()).mean()), float((ours[seen] > ends[1].mean()).mean())
    phase = waveform = np.nan
    if np.isfinite(periods).all() and min(amplitude) > 0:
        times: Array = step_s * np.arange(len(ours), dtype=float)
        pairs = [(one[seen], times[seen], length) for one, length in zip((theirs, ours), periods, strict=True)]
        turns = [_fundamental(*pair) for pair in pairs]
        phase = float(np.angle(turns[1] / turns[0]) / (2.0 * np.pi))
        measured, simulated = (_mean_cycle(*pair) for pair in pairs)
        waveform = max(_correlated(measured, np.roll(simulated, shift)) for shift in range(len(simulated)))
    relative = rms / amplitude[0] if amplitude[0] > 0 else np.nan
    return SignalAgreement(
        signal, unit, int(seen.sum()), rms, float(off.mean()) if off.size else np.nan, relative,
        amplitude, duty, phase, waveform,
    )  # fmt: skip


def _fundamental(values: Array, time_s: Array, period_s: float) -> np.complex128:
    """The Fourier coefficient at one over the period."""
    return np.mean((values - values.mean()) * np.exp(-2j * np.pi * time_s / period_s))


def _mean_cycle(values: Array, time_s: Array, period_s: float, bins: int = 40) -> Array:
    """The mean over cycles at ``bins`` phases, interpolated where a gap leaves one empty."""
    mean, _, _ = binned_statistic(time_s / period_s % 1.0, values, bins=bins, range=(0.0, 1.0))
    filled = np.flatnonzero(np.isfinite(mean))
    return np.interp(np.arange(bins), filled, mean[filled], period=bins)


def _correlated(a: Array, b: Array) -> float:
    seen = np.isfinite(a) & np.isfinite(b)
    x, y = a[seen] - a[seen].mean(), b[seen] - b[seen].mean()
    spread = float(np.sqrt((x**2).sum() * (y**2).sum())) if seen.any() else 0.0
    return float((x * y).sum()) / spread if spread > 0 else np.nan


def _standardised(signals: Array) -> Array:
    mean, spread = np.nanmean(signals, axis=1, keepdims=True), np.nanstd(signals, axis=1, keepdims=True)
    return (signals - mean) / np.where(spread > 0, spread, 1.0)


def _autocorrelation(signals: Array) -> Array:
    """Unnormalised, at lags from 0 on, ``(k, n)``."""
    n = signals.shape[1]
    transform = np.fft.rfft(signals, 2 * n, axis=1)
    return np.fft.irfft(np.abs(transform) ** 2, 2 * n, axis=1)[:, :n]


def _vertex(before: float, at: float, after: float) -> float:
    """Where between -0.5 and 0.5 the parabola through three values at -1, 0 and 1 has its vertex."""
    bend = before - 2.0 * at + after
    return float(0.5 * (before - after) / bend) if bend < 0 else 0.0


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _plain(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
