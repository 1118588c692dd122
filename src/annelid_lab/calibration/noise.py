"""How far measured points lie from a model: noise of each point, and a discrepancy that changes slowly along them.

The covariance of two points of one series is ``s^2 [same point] + d^2 exp(-|distance| / l)``: white noise, and what the
model leaves out, as a first-order autoregression (Kennedy and O'Hagan, J. R. Stat. Soc. B 63, 2001, with that kernel).
Neighbours that err alike count as fewer points. The sizes are found by restricted maximum likelihood, so what the
parameters have fitted away is counted too.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log, sqrt

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from annelid.protocols import Array
from annelid_lab.calibration.base import Data

LEAST = 1e-4
"""Least size of noise and discrepancy, of the range of the values."""


@dataclass(frozen=True)
class Noise:
    """Errors of one experiment.

    Attributes:
        noise: Standard deviation of the noise of a point, in the values' unit.
        discrepancy: The same of what the model leaves out; 0 where none is known.
        length: Distance along the points over which that is correlated.
    """

    noise: float
    discrepancy: float = 0.0
    length: float = 1.0

    def covariance(self, data: Data) -> Array:
        """Covariance of points, ``(n, n)``."""
        distance = np.abs(data.at[:, None] - data.at)
        alike = data.series[:, None] == data.series
        return self.discrepancy**2 * np.exp(-distance / self.length) * alike + self.noise**2 * np.eye(len(data.at))

    def root(self, data: Data, scatter: Array | None = None) -> Array:
        """Lower root of the covariance, with another one added: it makes errors independent, of a deviation of 1."""
        covariance = self.covariance(data)
        return cholesky(covariance if scatter is None else covariance + scatter, lower=True)

    def freedom(self, data: Data) -> float:
        """How many independent points would give the size of the errors as well as these do."""
        total = self.noise**2 + self.discrepancy**2
        return float(len(data.at) ** 2 / ((self.covariance(data) / total) ** 2).sum())

    def effective_points(self, data: Data) -> float:
        """How many independent points would give the mean of the points as well as these do."""
        total = self.noise**2 + self.discrepancy**2
        root = self.root(data) / sqrt(total)
        ones = solve_triangular(root, np.ones(len(data.at)), lower=True)
        return float(min(ones @ ones, len(data.at)))


def estimated(
    data: Data,
    residual: Array,
    jacobian: Array,
    elsewhere: Array,
    stated: float | None,
    scatter: Array | None = None,
) -> Noise:
    """Estimates the errors of one experiment by restricted maximum likelihood.

    Args:
        data: Its points.
        residual: Measured less fitted, ``(n,)``.
        jacobian: Change of the predicted points with the parameters, ``(n, p)``.
        elsewhere: What other experiments and priors know of the parameters: inverse covariance, ``(p, p)``.
        stated: Standard deviation of the noise, where it is known.
        scatter: Further covariance of the points that is known, ``(n, n)``.
    """
    from scipy.optimize import minimize

    scale = max(float(np.ptp(data.values)), 1e-300)
    size = max(float(np.sqrt((residual**2).mean())), LEAST * scale)
    steps = [np.diff(np.unique(data.at[data.series == one])) for one in np.unique(data.series)]
    reach = max(float(step.sum()) for step in steps)
    spacing = float(np.median(np.concatenate(steps)))

    def errors(logs: Array) -> Noise:
        noise = stated if stated is not None else exp(logs[2])
        return Noise(noise, exp(logs[0]), exp(logs[1]))

    def misfit(logs: Array) -> float:
        root = errors(logs).root(data, scatter)
        whitened = solve_triangular(root, np.column_stack([residual, jacobian]), lower=True)
        r, j = whitened[:, 0], whitened[:, 1:]
        known = elsewhere + j.T @ j
        # Two parameters that do the same would leave it singular.
        known = cholesky(known + (1e-10 * np.trace(known) + 1e-300) * np.eye(len(known)), lower=True)
        gone = solve_triangular(known, j.T @ r, lower=True)
        return float(2 * np.log(np.diag(root)).sum() + 2 * np.log(np.diag(known)).sum() + r @ r - gone @ gone)

    # A discrepancy as long as the data would be told apart from no parameter, a shorter one than two points not from
    # noise.
    bounds = [(log(LEAST * size), log(10 * size)), (log(2 * spacing), log(max(reach / 4, 3 * spacing)))]
    if stated is None:
        bounds.append((log(LEAST * scale), log(10 * size)))
    shares = ((0.7, 5 * spacing, 0.7), (0.05, 2 * spacing, 1.0), (0.9, reach / 3, 0.2))
    starts = [[log(slow * size), log(length), log(fast * size)][: len(bounds)] for slow, length, fast in shares]
    starts = [np.clip(start, *np.transpose(bounds)) for start in starts]
    found = [minimize(misfit, start, bounds=bounds, method="L-BFGS-B", options={"maxiter": 60}) for start in starts]
    return errors(min(found, key=lambda one: one.fun).x)


def whitened(root: Array, values: Array) -> Array:
    """Divides values or columns by the lower root of their covariance."""
    return solve_triangular(root, values, lower=True)
