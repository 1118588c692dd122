"""How well a fit determines its parameters: profile likelihood, and what cannot be told apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from annelid.protocols import Array
from annelid_lab.calibration.base import Data
from annelid_lab.calibration.fit import SINGULAR, Fit, Part, prior_rows
from annelid_lab.calibration.model import Model
from annelid_lab.calibration.noise import whitened

LEVEL = 0.95
"""Of the intervals."""
FEWEST_FREE = 2.0
"""Degrees of freedom at least, of the errors of an experiment."""
WIDEST = 3.0
"""How many times as wide as the linear interval a profile is followed."""


@dataclass(frozen=True)
class Intervals:
    """What is known of the parameters, 95 % each.

    Attributes:
        profile: By profile likelihood, and up to the fitted value where that lies outside, ``(p, 2)``.
        relative_error: Standard error of the logarithm of each, ``(p,)``.
        correlation: Of these, ``(p, p)``.
        errors: Relative standard errors of independent combinations of the parameters, greatest first, ``(p,)``.
        directions: The combinations, a row each, in relative changes, ``(p, p)``.
        quantile: Standard errors from the value to the end of an interval, ``(p,)``.
        held_out: Points that were held out, and how many of them lie in the intervals predicted, by experiment.
    """

    profile: Array
    relative_error: Array
    correlation: Array
    errors: Array
    directions: Array
    quantile: Array
    held_out: dict[str, tuple[int, int]]


def intervals(fit: Fit, model: Model) -> Intervals:
    """Finds the intervals of a fit."""
    quantile = _quantiles(fit)
    error = np.sqrt(np.diag(fit.covariance))
    values, vectors = np.linalg.eigh(fit.information)
    correlation = fit.covariance / np.outer(error, error)
    errors = 1.0 / np.sqrt(np.maximum(values, SINGULAR * max(values[-1], 1.0)))
    low, high = _profile(fit, model, error, quantile).T
    fitted = np.exp(fit.logs)
    return Intervals(
        profile=np.column_stack([np.minimum(low, fitted), np.maximum(fitted, high)]),
        relative_error=error,
        correlation=correlation,
        errors=errors,
        directions=vectors.T,
        quantile=quantile,
        held_out={part.experiment.name: _inside(fit, part) for part in fit.parts if len(part.held.at)},
    )


def _freedom(fit: Fit, part: Part) -> float:
    """Degrees of freedom of an experiment's errors, less the parameters that it determines.

    Of one that is held out, the fewest of those that are fitted, which its interval rests on.
    """
    if not part.is_fitted:
        return min(_freedom(fit, other) for other in fit.parts if other.is_fitted)
    fitted_away = float(np.trace(fit.covariance @ part.information))
    return max(part.noise.freedom(part.data) - fitted_away, FEWEST_FREE)


def _quantiles(fit: Fit) -> Array:
    """Student's quantile of each parameter, ``(p,)``.

    The degrees of freedom are Satterthwaite's: those of the experiments, each by its share of the parameter's variance.
    """
    from scipy.stats import t

    # The variance of a parameter is C, that of the part's points through the gains C J' R^-1: C (J' R^-1 J) C.
    shares = [np.diag(fit.from_noise @ part.information @ fit.from_noise) for part in fit.parts]
    total = np.maximum(np.diag(fit.covariance), 1e-300)
    slack = sum((share / total) ** 2 / _freedom(fit, part) for share, part in zip(shares, fit.parts, strict=True))
    slack += (np.diag(fit.from_scatter) / total) ** 2 / max(fit.emulator.spare, 1)
    return t.ppf(0.5 + LEVEL / 2, 1.0 / np.maximum(slack, 1e-9))


def band(fit: Fit, part: Part, data: Data, jacobian: Array, scatter: Array) -> Array:
    """Half of the interval that the fit predicts for points of an experiment, ``(n,)``."""
    from scipy.stats import t

    quantile = float(t.ppf(0.5 + LEVEL / 2, _freedom(fit, part)))
    variance = np.einsum("np,pq,nq->n", jacobian, fit.covariance, jacobian)
    return quantile * np.sqrt(variance + np.diag(part.noise.covariance(data)) + scatter)


def _profile(fit: Fit, model: Model, error: Array, quantile: Array) -> Array:
    """Ends of the profile likelihood's intervals, ``(p, 2)``.

    Each parameter is moved to the end of its linear interval and the others with it as the linear model says; there the
    emulator is asked, and the others are refitted by one step of Gauss and Newton. The misfit is taken to grow with the
    square of the way, so its rise there says where it reaches the quantile.
    """
    low, high = model.low, model.high
    linear = np.sqrt(np.diag(fit.from_noise))
    reach = quantile * linear
    base = _misfit(fit, [part.smooth for part in fit.parts], fit.middle, None)
    ends = np.empty((len(fit.middle), 2))
    for i in range(len(fit.middle)):
        along = fit.from_noise[i] / fit.from_noise[i, i]
        for side, sign in enumerate((-1.0, 1.0)):
            moved = np.clip(fit.middle + sign * reach[i] * along, low, high)
            way = (moved - fit.middle)[i]
            if (np.abs(moved - fit.emulator.centre) > WIDEST * fit.emulator.radius).any():
                # So far away the emulator knows nothing: the linear interval stands.
                ends[i, side] = np.clip(fit.middle[i] + sign * quantile[i] * error[i], low[i], high[i])
                continue
            there = fit.emulator.predicted(moved)
            fitted = [one[~held] for one, held in zip(there, model.rows, strict=True)]
            rise = _misfit(fit, fitted, moved, i) - base
            stretch = quantile[i] / sqrt(rise) if rise > (quantile[i] / WIDEST) ** 2 else WIDEST
            # A way that was cut at a bound counts as far as it went.
            ends[i, side] = np.clip(fit.middle[i] + way * stretch * error[i] / linear[i], low[i], high[i])
    return np.exp(ends)


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
    inside = np.abs(part.held.values - part.held_fitted) <= band(
        fit, part, part.held, part.held_jacobian, part.held_scatter
    )
    return len(inside), int(inside.sum())
