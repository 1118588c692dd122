"""From scores to a ranking: means, paired differences and ranks, with intervals by bootstrap over draws and tasks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import inf, nan, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest, rankdata, studentized_range

from annelid_studies.challenge.scores import Score
from annelid_studies.challenge.tasks import REFERENCE
from annelid_studies.tables import grouped

ALL = "all"
"""What stands for a body or a task in the ranking over all of them."""
TRAVELS, LEAST_M_PER_S = 0.1, 0.001
"""A run travels above this share of the reference's mean speed on the task, and above this speed."""
LEAST_REFERENCE_M_PER_S = 0.005
"""A ratio is to the reference's mean speed, but to no less than this."""
RESAMPLES = 2000
Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Standing:
    """How an entrant did on a task, or on all of them.

    Intervals are of 95 %, of shares after Wilson, else by bootstrap over tasks and draws; NaN where there is nothing to
    tell. A ratio is the speed over the reference's mean on the same body and task, to 5 mm/s where that is slower.
    Energies are sums over runs that were not refused, over their whole way.
    """

    entrant: str
    body: str  # `ALL` for all
    task: str  # `ALL` for all
    draws: int  # Of every task
    speed_m_per_s: float
    speed_low: float
    speed_high: float
    ratio: float
    ratio_low: float
    ratio_high: float
    robust: float  # Share of runs that travel in order
    robust_low: float
    robust_high: float
    refused: float  # Share that was refused
    slip_J_per_m: float
    work_J_per_m: float
    electric_J_per_m: float


@dataclass(frozen=True, slots=True)
class Pair:
    """Two entrants on the same draws.

    Attributes:
        first: The one.
        second: The other.
        body: `ALL` for all.
        task: `ALL` for all; single tasks have pairs with the reference only.
        difference: Mean ratio of the first less that of the second, with its 95 % interval by bootstrap.
        difference_low: Lower end.
        difference_high: Upper end.
        faster: Share of tasks and draws in which the first is faster, half of those in which both are alike.
        faster_low: Lower end of its interval.
        faster_high: Upper end.
        slip: Work lost to friction per metre by the first, over that by the second, of the runs that neither was
            refused and in which both got ahead; NaN if there are none.
        slip_low: Lower end of its interval.
        slip_high: Upper end.
        work: The same of the muscles' positive work.
        work_low: Lower end of its interval.
        work_high: Upper end.
        at_half_step: The difference at half the step, on the draws that were run there; NaN if none were.
        at_step: The difference at the tasks' step on the same draws.
    """

    first: str
    second: str
    body: str
    task: str
    difference: float
    difference_low: float
    difference_high: float
    faster: float
    faster_low: float
    faster_high: float
    slip: float
    slip_low: float
    slip_high: float
    work: float
    work_low: float
    work_high: float
    at_half_step: float
    at_step: float


class Speeds:
    """Speeds of entrants over cells, each a task on a body, and draws.

    Attributes:
        entrants: Their names.
        cells: Body and task of every cell.
        speed_m_per_s: ``(n_entrants, n_cells, n_draws)``.
        ratio: The same over the reference's mean of the cell.
        way_m: Ways, likewise; NaN where the worm did not get ahead.
        slip_J: Work lost to friction, likewise.
        work_J: Positive work of the muscles, likewise.
    """

    def __init__(self, scores: Sequence[Score]) -> None:
        """Arranges scores; every entrant must have run every cell with the same draws, the reference among them."""
        of = {(one.entrant, (one.body, one.task), one.seed): one for one in scores}
        self.entrants = list(dict.fromkeys(name for name, _, _ in of))
        self.cells = list(dict.fromkeys(cell for _, cell, _ in of))
        seeds = list(dict.fromkeys(seed for _, _, seed in of))

        def each(name: str) -> Array:
            return np.array(
                [[[getattr(of[e, cell, seed], name) for seed in seeds] for cell in self.cells] for e in self.entrants]
            )

        self.speed_m_per_s = each("speed_m_per_s")
        mean = self.speed_m_per_s[self.entrants.index(REFERENCE)].mean(axis=-1)
        self.ratio: Array = self.speed_m_per_s / np.maximum(mean, LEAST_REFERENCE_M_PER_S)[:, np.newaxis]
        way_m = each("distance_m")
        self.way_m, self.slip_J, self.work_J = np.where(way_m > 0, way_m, np.nan), each("slip_J"), each("work_J")

    def of(self, body: str, task: str) -> list[int]:
        """Returns the numbers of the cells of a body and a task, or of all."""
        return [i for i, cell in enumerate(self.cells) if body in (ALL, cell[0]) and task in (ALL, cell[1])]


def _interval(values: Array) -> tuple[float, float, float]:
    """Returns the mean over cells and draws, ``(n_cells, n_draws)``, and its interval by bootstrap (percentiles)."""
    if values.shape[1] < 2:
        return float(values.mean()), nan, nan
    low, high = np.percentile(values[_resampled(*values.shape)].mean(axis=(1, 2)), (2.5, 97.5)).tolist()
    return float(values.mean()), low, high


def _resampled(n_cells: int, n_draws: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Draws cells, and draws of each cell, with replacement, `RESAMPLES` times."""
    rng = np.random.default_rng(0)
    cells = rng.integers(n_cells, size=(RESAMPLES, n_cells))[..., np.newaxis]
    return cells, rng.integers(n_draws, size=(RESAMPLES, n_cells, n_draws))


def _cost_ratio(energy_J: Array, way_m: Array) -> tuple[float, float, float]:
    """Returns energy per metre of the first entrant over that of the second, and its interval by bootstrap.

    Args:
        energy_J: ``(2, n_cells, n_draws)``.
        way_m: Likewise. Runs in which either of both is NaN do not count.
    """
    counts = np.isfinite(energy_J * way_m).all(axis=0)
    if not counts.any():
        return nan, nan, nan
    energy, way = (np.where(counts, values, 0.0) for values in (energy_J, way_m))

    def ratio(axes: tuple[int, int], where: tuple[NDArray[np.int64], ...] = ()) -> Array:
        first, second = ((e[where].sum(axis=axes) / w[where].sum(axis=axes)) for e, w in zip(energy, way, strict=True))
        return first / second

    mean = float(ratio((0, 1)))
    if way_m.shape[-1] < 2:
        return mean, nan, nan
    with np.errstate(invalid="ignore"):
        low, high = np.nanpercentile(ratio((1, 2), _resampled(*way_m.shape[1:])), (2.5, 97.5)).tolist()
    return mean, low, high


def standings(scores: Sequence[Score]) -> list[Standing]:
    """Ranks entrants at the tasks' step: over all tasks, then those of each body, then of each task on each body.

    Each group begins with the entrant that is fastest over all.
    """
    at_step = [one for one in scores if one.finer == 1]
    speeds = Speeds(at_step)
    best = np.argsort(-speeds.ratio.mean(axis=(1, 2)), kind="stable").tolist()
    runs = grouped(at_step, lambda one: one.entrant)
    found = []
    for body, task in _groups(speeds):
        cells = speeds.of(body, task)
        for i in best:
            name = speeds.entrants[i]
            own = [one for one in runs[name] if body in (ALL, one.body) and task in (ALL, one.task)]
            numbers = (
                *_interval(speeds.speed_m_per_s[i, cells]),
                *_interval(speeds.ratio[i, cells]),
                *_share([one.in_order and _travels(one, speeds) for one in own]),
                float(np.mean([bool(one.refused) for one in own])),
                *(_per_metre(own, energy) for energy in ("slip_J", "work_J", "electric_J")),
            )
            draws = speeds.ratio.shape[-1]
            found.append(Standing(name, body, task, draws, *(float(f"{number:.5g}") for number in numbers)))
    return found


def _travels(score: Score, speeds: Speeds) -> bool:
    cell = speeds.cells.index((score.body, score.task))
    reference = float(speeds.speed_m_per_s[speeds.entrants.index(REFERENCE), cell].mean())
    return score.speed_m_per_s > max(TRAVELS * reference, LEAST_M_PER_S)


def _share(which: Sequence[bool]) -> tuple[float, float, float]:
    """A share of runs with its 95 % interval after Wilson 1927, which is no point where all runs agree."""
    found = binomtest(sum(which), len(which)).proportion_ci(method="wilson")
    return float(np.mean(which)), float(found.low), float(found.high)


def _per_metre(scores: Sequence[Score], energy: str) -> float:
    """The sum of an energy over the sum of ways; infinite for a worm that gets nowhere."""
    count = [one for one in scores if not one.refused]
    way = sum(one.distance_m for one in count)
    return sum(getattr(one, energy) for one in count) / way if way > 0.0 else inf


def pairs(scores: Sequence[Score]) -> list[Pair]:
    """Compares every two entrants on the same draws: over all tasks, on each body, with the reference on each task."""
    speeds = Speeds([one for one in scores if one.finer == 1])
    finer = {(one.entrant, one.body, one.task, one.seed) for one in scores if one.finer != 1}
    twice = [one for one in scores if (one.entrant, one.body, one.task, one.seed) in finer]
    coarse, fine = ([one for one in twice if (one.finer == 1) == at_step] for at_step in (True, False))
    beside = (Speeds(coarse), Speeds(fine)) if finer else None
    found = []
    for body, task in _groups(speeds):
        cells = speeds.of(body, task)
        for first, second in combinations(speeds.entrants, 2):
            if task != ALL and REFERENCE not in (first, second):
                continue
            both = [speeds.entrants.index(name) for name in (first, second)]
            one, other = speeds.ratio[both][:, cells]
            numbers = (*_interval(one - other), *_interval((one > other) + 0.5 * (one == other)))
            for energy in (speeds.slip_J, speeds.work_J):
                numbers += _cost_ratio(energy[both][:, cells], speeds.way_m[both][:, cells])
            steps = (nan, nan) if beside is None else [_difference(each, both, body, task) for each in beside[::-1]]
            found.append(Pair(first, second, body, task, *(float(f"{number:.4g}") for number in (*numbers, *steps))))
    return found


def _groups(speeds: Speeds) -> list[tuple[str, str]]:
    """All tasks on all bodies, then on each body, then each task on each body."""
    return [(ALL, ALL), *((body, ALL) for body in dict.fromkeys(b for b, _ in speeds.cells)), *speeds.cells]


def _difference(speeds: Speeds, both: Sequence[int], body: str, task: str) -> float:
    one, other = speeds.ratio[both][:, speeds.of(body, task)]
    return float((one - other).mean()) if one.size else nan


def half_step_changes(scores: Sequence[Score]) -> dict[str, Array]:
    """Returns how much an entrant's mean speed changes at half the step, relative, of every cell that was run there.

    Cells in which it is slower than 5 mm/s at both steps are left out.
    """
    by = grouped(scores, lambda one: (one.entrant, one.body, one.task, one.seed))
    twice = [own for own in by.values() if len({one.finer for one in own}) > 1]
    cells = grouped(twice, lambda own: (own[0].entrant, own[0].body, own[0].task))
    found: dict[str, list[float]] = {}
    for (entrant, _, _), draws in cells.items():
        coarse, fine = (
            float(np.mean([one.speed_m_per_s for own in draws for one in own if (one.finer == 1) == at_step]))
            for at_step in (True, False)
        )
        if max(coarse, fine) >= LEAST_REFERENCE_M_PER_S:
            found.setdefault(entrant, []).append(fine / coarse - 1.0 if coarse else inf)
    return {name: np.array(changes) for name, changes in found.items()}


def mean_ranks(speeds: Speeds) -> tuple[Mapping[str, float], float]:
    """Returns the mean rank of every entrant over cells, 1 the fastest, and the critical difference of Nemenyi.

    Two mean ranks that differ by less are not told apart at 5 % (Demsar 2006, equation for the Nemenyi test).
    """
    ranks = rankdata(-speeds.speed_m_per_s.mean(axis=-1), axis=0).mean(axis=1)
    k, n = len(speeds.entrants), len(speeds.cells)
    critical = float(studentized_range.ppf(0.95, k, inf)) / sqrt(2.0) * sqrt(k * (k + 1) / (6.0 * n)) if k > 1 else nan
    return dict(zip(speeds.entrants, ranks.tolist(), strict=True)), critical
