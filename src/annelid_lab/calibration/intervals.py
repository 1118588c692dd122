"""How well a fit determines its parameters: profile likelihood, and what cannot be told apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, sqrt

import numpy as np

from annelid.errors import SimulationStopped
from annelid.protocols import Array
from annelid_lab.calibration.base import Data
from annelid_lab.calibration.fit import SINGULAR, Fit, Model, Part, bounds, prior_rows
from annelid_lab.calibration.noise import whitened

LEVEL = 0.95
"""Of the intervals."""
FEWEST_FREE = 2.0
"""Degrees of freedom at least, of the errors of an experiment."""
WIDEST = 3.0
"""How many times as wide as the linear interval a profile is followed."""
UNKNOWN = 0.3
"""Relative error of a combination of parameters above which the data do not determine it."""
ALIKE = 0.9
"""Correlation above which two parameters are not told apart."""


@dataclass(frozen=True)
class Intervals:
    """What is known of the parameters, 95 % each.

    Attributes:
        profile: By profile likelihood, ``(p, 2)``.
        relative_error: Standard error of the logarithm of each, ``(p,)``.
        correlation: Of these, ``(p, p)``.
        errors: Relative standard errors of independent combinations of the parameters, greatest first, ``(p,)``.
        directions: The combinations, a row each, in relative changes, ``(p, p)``.
        quantile: Standard errors from the value to the end of an interval, ``(p,)``.
        confused: What the data cannot tell apart, a sentence each.
        held_out: Points that were held out, and how many of them lie in the intervals predicted, by experiment.
    """

    profile: Array
    relative_error: Array
    correlation: Array
    errors: Array
    directions: Array
    quantile: Array
    confused: tuple[str, ...]
    held_out: dict[str, tuple[int, int]]


def intervals(fit: Fit, model: Model) -> Intervals:
    """Finds the intervals of a fit; the profile takes two tests of each experiment for every parameter."""
    quantile = _quantiles(fit)
    error = np.sqrt(np.diag(fit.covariance))
    values, vectors = np.linalg.eigh(fit.information)
    correlation = fit.covariance / np.outer(error, error)
    errors = 1.0 / np.sqrt(np.maximum(values, SINGULAR * values[-1]))
    return Intervals(
        profile=_profile(fit, model, error, quantile),
        relative_error=error,
        correlation=correlation,
        errors=errors,
        directions=vectors.T,
        quantile=quantile,
        confused=confused(fit.names, correlation, errors, vectors.T),
        held_out={part.experiment.name: _inside(fit, part) for part in fit.parts if len(part.held.at)},
    )


def _freedom(fit: Fit, part: Part) -> float:
    """Degrees of freedom of an experiment's errors, less the parameters that it determines."""
    fitted_away = float(np.trace(fit.covariance @ part.information))
    return max(part.noise.freedom(part.data) - fitted_away, FEWEST_FREE)


def _quantiles(fit: Fit) -> Array:
    """Student's quantile of each parameter, ``(p,)``.

    The degrees of freedom are Satterthwaite's: those of the experiments, each by its share of the parameter's variance.
    """
    from scipy.stats import t

    # The variance of a parameter is C, that of the part's points through the gains C J' R^-1: C (J' R^-1 J) C.
    shares = [np.diag(fit.covariance @ part.information @ fit.covariance) for part in fit.parts]
    total = np.maximum(np.diag(fit.covariance), 1e-300)
    slack = sum((share / total) ** 2 / _freedom(fit, part) for share, part in zip(shares, fit.parts, strict=True))
    return t.ppf(0.5 + LEVEL / 2, 1.0 / np.maximum(slack, 1e-9))


def band(fit: Fit, part: Part, data: Data, jacobian: Array) -> Array:
    """Half of the interval that the fit predicts for points of an experiment, ``(n,)``."""
    from scipy.stats import t

    quantile = float(t.ppf(0.5 + LEVEL / 2, _freedom(fit, part)))
    variance = np.einsum("np,pq,nq->n", jacobian, fit.covariance, jacobian)
    return quantile * np.sqrt(variance + np.diag(part.noise.covariance(data)))


def _profile(fit: Fit, model: Model, error: Array, quantile: Array) -> Array:
    """Ends of the profile likelihood's intervals, ``(p, 2)``.

    Each parameter is moved to the end of its linear interval and the others with it as the linear model says; there all
    experiments are simulated, and the others are refitted by one step of Gauss and Newton. The misfit is taken to grow
    with the square of the way, so its rise there says where it reaches the quantile.
    """
    low, high = bounds(fit.study)
    p = len(fit.logs)
    reach = quantile * error
    ways = np.array([sign * reach[i] for i in range(p) for sign in (-1.0, 1.0)])
    along = np.repeat(fit.covariance / np.diag(fit.covariance), 2, axis=1).T
    moved = np.clip(fit.logs + ways[:, None] * along, low, high)
    ways = (moved - fit.logs)[np.arange(2 * p), np.repeat(np.arange(p), 2)]
    base = _misfit(fit, [part.fitted for part in fit.parts], fit.logs, None)
    ends = np.empty(2 * p)
    try:
        there = model.predicted(list(moved), "profile likelihood")
    except SimulationStopped:
        # A worm at an end gives way: the linear intervals stand.
        return np.exp(np.clip(fit.logs[:, None] + reach[:, None] * [-1.0, 1.0], low[:, None], high[:, None]))
    for k in range(2 * p):
        i = k // 2
        fitted = [one[~held] for one, held in zip(there[k], model.rows, strict=True)]
        rise = _misfit(fit, fitted, moved[k], i) - base
        stretch = quantile[i] / sqrt(rise) if rise > (quantile[i] / WIDEST) ** 2 else WIDEST
        # A way that was cut at a bound counts as far as it went.
        ends[k] = np.clip(fit.logs[i] + ways[k] * stretch, low[i], high[i])
    return np.exp(ends.reshape(p, 2))


def _misfit(fit: Fit, fitted: Sequence[Array], logs: Array, fixed: int | None) -> float:
    """Sum of squares of the residuals in standard deviations once the parameters but a fixed one are refitted."""
    pairs = zip(fit.parts, fitted, strict=True)
    rows = [(whitened(p.root, p.data.values - there), whitened(p.root, p.jacobian)) for p, there in pairs]
    prior, slope = prior_rows(fit.study, logs)
    r = np.concatenate([*(row[0] for row in rows), -prior])
    j = np.concatenate([*(row[1] for row in rows), slope])
    if fixed is not None:
        j = np.delete(j, fixed, axis=1)
    if j.shape[1]:
        r = r - j @ np.linalg.lstsq(j, r, rcond=None)[0]
    return float(r @ r)


def _inside(fit: Fit, part: Part) -> tuple[int, int]:
    """Points held out, and how many lie in the intervals that the fit predicts for them."""
    inside = np.abs(part.held.values - part.held_fitted) <= band(fit, part, part.held, part.held_jacobian)
    return len(inside), int(inside.sum())


def confused(names: Sequence[str], correlation: Array, errors: Array, directions: Array) -> tuple[str, ...]:
    """Says which parameters the data cannot tell apart.

    Args:
        names: Of the parameters, ``(p,)``.
        correlation: Of the errors of their logarithms, ``(p, p)``.
        errors: Relative errors of independent combinations, greatest first, ``(p,)``.
        directions: The combinations, ``(p, p)``.
    """
    found: list[str] = []
    for error, direction in zip(errors, directions, strict=True):
        if error <= UNKNOWN:
            continue
        direction = direction / direction[np.abs(direction).argmax()]
        shares = [(n, float(s)) for n, s in zip(names, direction, strict=True) if abs(s) > 0.1]
        up = [name for name, share in shares if share > 0]
        down = [name for name, share in shares if share < 0]
        if len(shares) == 1:
            found.append(f"the data do not determine {up[0]}: its relative error is {error:.3g}")
        else:
            how = f"raising {' and '.join(up)}" + (f" while lowering {' and '.join(down)}" if down else "")
            by = f"by {exp(error) - 1:.0%}" if error < 1.0 else "by any factor"
            found.append(f"the data do not tell {' and '.join(n for n, _ in shares)} apart: {how} {by} changes nothing")
    pairs = [(names[k], names[i], correlation[i, k]) for i in range(len(names)) for k in range(i)]
    alike = (f"{one} and {other} are correlated by {by:+.2f}" for one, other, by in pairs if abs(by) > ALIKE)
    return (*found, *alike)
