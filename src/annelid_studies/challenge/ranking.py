"""From scores to a ranking: means with bootstrap intervals, differences to the reference, shares, and stability."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest, bootstrap, kendalltau

from annelid_studies.challenge.scores import Score
from annelid_studies.challenge.tasks import REFERENCE
from annelid_studies.tables import grouped

ALL = "all"
"""What stands for a task in the ranking over all of them."""
TRAVELS, LEAST_M_PER_S = 0.1, 0.001
"""A run travels above this share of the reference's mean speed on the task, and above this speed."""
LEAST_REFERENCE_M_PER_S = 0.005
"""A ratio is to the reference's mean speed, but to no less than this."""
PERIOD_TOLERANCE = 0.1
"""A run is in time if it is in order with a period this near to the median of its entrant's, for its segments."""
RESAMPLES = 2000
Array = NDArray[np.float64]
COLUMNS = (
    "speed",
    "gain",
    "ratio",
    "robust",
    "in_order",
    "in_time",
    "travels",
    "refused",
    "slip",
    "work",
    "electric",
    "distance",
    "recovery",
)
"""What is kept of every run for the means."""


@dataclass(frozen=True, slots=True)
class Standing:
    """How an entrant did on a task, or on all of them.

    Intervals are of 95 %, of shares after Wilson, else by bootstrap over draws; NaN where there is nothing to tell. A
    gain is the mean difference to the reference on the same draws, a ratio the mean speed over the reference's; over
    all tasks both are means of the tasks'. Energies are sums over runs that were not refused, over their whole way.
    """

    entrant: str
    task: str  # `ALL` for all
    draws: int  # Of every task
    speed_m_per_s: float
    speed_low: float
    speed_high: float
    worst_m_per_s: float  # Slowest run
    gain_m_per_s: float
    gain_low: float
    gain_high: float
    ratio: float
    ratio_low: float
    ratio_high: float
    robust: float  # Share of runs that travel in order
    robust_low: float
    robust_high: float
    in_order: float  # Share in order
    in_time: float  # Share in time
    in_time_low: float
    in_time_high: float
    travels: float  # Share that travels
    travels_low: float
    travels_high: float
    refused: float  # Share that was refused
    recovery_s: float  # Mean of the runs that recovered
    slip_J_per_m: float
    work_J_per_m: float
    electric_J_per_m: float
    electric_low: float
    electric_high: float


def interval(values: Array, statistic: Callable[[Array], Array]) -> tuple[float, float, float]:
    """Returns a statistic, and its 95 % bootstrap interval over draws (percentiles); NaN for a single draw.

    Draws of one task have nothing to do with those of another, so each task's are drawn anew by themselves.

    Args:
        values: Numbers of every draw, ``(n_draws, n_tasks, n_columns)``.
        statistic: From means over draws, ``(.., n_tasks, n_columns)``, to numbers, ``(..)``.
    """

    def of_draws(*of_tasks: NDArray[np.int64], axis: int = -1) -> Array:
        means = [values[index, task].mean(axis=-2) for task, index in enumerate(of_tasks)]
        return statistic(np.stack(means, axis=-2))

    n_draws, n_tasks = values.shape[:2]
    draws = (np.arange(n_draws),) * n_tasks
    if n_draws < 2:
        return float(of_draws(*draws)), nan, nan
    # It computes a standard error as well, which an infinite number does not have.
    with np.errstate(invalid="ignore"):
        found = bootstrap(draws, of_draws, n_resamples=RESAMPLES, method="percentile", rng=0).confidence_interval
    return float(of_draws(*draws)), float(found.low), float(found.high)


def _mean(column: str) -> Callable[[Array], Array]:
    """The mean of a column over tasks."""
    return lambda means: means[..., COLUMNS.index(column)].mean(axis=-1)


def _share(which: Array) -> tuple[float, float, float]:
    """A share of runs with its 95 % interval after Wilson 1927, which is no point where all runs agree."""
    found = binomtest(int(which.sum()), which.size).proportion_ci(method="wilson")
    return float(which.mean()), float(found.low), float(found.high)


def _per_metre(column: str) -> Callable[[Array], Array]:
    """The sum of a column over the sum of distances; infinite for a worm that gets nowhere."""

    def over(means: Array) -> Array:
        energy, way = (means[..., COLUMNS.index(name)].sum(axis=-1) for name in (column, "distance"))
        return np.where(way > 0.0, energy / np.where(way > 0.0, way, 1.0), np.inf)

    return over


def standings(scores: Sequence[Score]) -> list[Standing]:
    """Ranks entrants: those over all tasks first, the fastest first, then those of each task.

    Every entrant must have run every task with the same draws, the reference among them.
    """
    by_task = grouped(scores, lambda one: one.task)
    of: dict[str, list[Array]] = {}
    periods = grouped((one for one in scores if one.in_order), lambda one: (one.entrant, one.segments))
    own_period_s = {key: float(np.median([one.period_s for one in own])) for key, own in periods.items()}
    for own in by_task.values():
        by_entrant = grouped(sorted(own, key=lambda one: one.seed), lambda one: one.entrant)
        reference = np.array([one.speed_m_per_s for one in by_entrant[REFERENCE]])
        for name, each in by_entrant.items():
            of.setdefault(name, []).append(_values(each, reference, own_period_s))
    overall = [_standing(name, ALL, np.stack(values, axis=1)) for name, values in of.items()]
    overall.sort(key=lambda one: -one.ratio)
    best = [one.entrant for one in overall]
    return overall + [
        _standing(name, task, of[name][i][:, np.newaxis]) for i, task in enumerate(by_task) for name in best
    ]


def _values(scores: Sequence[Score], reference_m_per_s: Array, own_period_s: Mapping[tuple[str, int], float]) -> Array:
    """The columns of one entrant's runs at a task, ``(n_draws, n_columns)``."""
    mean = float(reference_m_per_s.mean())
    rows = []
    for one, beside in zip(scores, reference_m_per_s.tolist(), strict=True):
        speed = one.speed_m_per_s
        travels = speed > max(TRAVELS * mean, LEAST_M_PER_S)
        of_own = one.period_s / own_period_s[one.entrant, one.segments] if one.in_order else nan
        in_time = abs(of_own - 1.0) <= PERIOD_TOLERANCE
        shares = travels and one.in_order, one.in_order, in_time, travels, bool(one.refused)
        spent = (0.0,) * 3 if one.refused else (one.slip_J, one.work_J, one.electric_J)
        rows.append(
            [
                speed,
                speed - beside,
                speed / max(mean, LEAST_REFERENCE_M_PER_S),
                *shares,
                *spent,
                one.distance_m,
                one.recovery_s,
            ]
        )
    return np.array(rows, dtype=float)


def _standing(name: str, task: str, values: Array) -> Standing:
    means, recovery = values.mean(axis=0), values[..., COLUMNS.index("recovery")]
    numbers = (
        *interval(values, _mean("speed")),
        float(values[..., COLUMNS.index("speed")].min()),
        *interval(values, _mean("gain")),
        *interval(values, _mean("ratio")),
        *_share(values[..., COLUMNS.index("robust")]),
        float(_mean("in_order")(means)),
        *_share(values[..., COLUMNS.index("in_time")]),
        *_share(values[..., COLUMNS.index("travels")]),
        float(_mean("refused")(means)),
        float(np.nanmean(recovery)) if np.isfinite(recovery).any() else nan,
        *(float(_per_metre(column)(means)) for column in ("slip", "work")),
        *interval(values, _per_metre("electric")),
    )
    return Standing(name, task, len(values), *(float(f"{number:.5g}") for number in numbers))


def agreement(one: Mapping[tuple[str, str], float], other: Mapping[tuple[str, str], float]) -> dict[str, float]:
    """Compares two rankings by task: Kendall's tau of the mean speeds of the entrants that are in both.

    Args:
        one: Mean speeds by entrant and task, from `mean_speeds`.
        other: Likewise.

    Returns:
        Tau by every task of the first; NaN where fewer than two of its entrants are in both and differ.
    """
    taus: dict[str, float] = {}
    for task, own in grouped(one, lambda key: key[1]).items():
        keys = [key for key in own if key in other]
        found: Any = kendalltau([one[key] for key in keys], [other[key] for key in keys])
        taus[task] = float(found.statistic)
    return taus


def mean_speeds(scores: Sequence[Score]) -> dict[tuple[str, str], float]:
    """Returns mean speeds by entrant and task, m/s."""
    by_pair = grouped(scores, lambda one: (one.entrant, one.task))
    return {pair: float(np.mean([one.speed_m_per_s for one in own])) for pair, own in by_pair.items()}
