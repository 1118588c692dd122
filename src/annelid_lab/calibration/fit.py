"""Fits a worm's parameters to all experiments of a study at once.

Generalised least squares over logarithms of the parameters. Worms spread over a region (Halton's sequence) are computed
side by side, an emulator is fitted to them (`model`), and its optimum is computed, too; the region follows and shrinks
to where the data leave the parameters open. Of all worms computed the one that fits best is kept. Fit and errors of the
points (`noise`) are found in turn, since each needs the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import sqrt
from pathlib import Path

import numpy as np

from annelid.errors import SimulationStopped
from annelid.protocols import Array
from annelid_lab.calibration.base import Data, Experiment
from annelid_lab.calibration.model import Emulator, Model, Tried, n_terms
from annelid_lab.calibration.noise import Noise, estimated, whitened
from annelid_lab.calibration.simulations import Simulations
from annelid_lab.calibration.study import IdentifyStudy

FIRST = 0.7
"""Radius of the first region in logarithms: half to twice the first guess."""
SHRINK = 0.3
"""Radius of a region of the one before."""
REACH = 4.0
"""Radius of the last region in standard errors, beside what the scatter of worms asks for."""
CLEAR = 3.0
"""How many times as far as worms scatter a parameter must move the points in the last region."""
ROUGH = 0.5
"""Share of their scatter in the region before, above which worms scatter whatever the region."""
LAST, SMOOTH = 4, 0.3
"""Worms in the last region, of the terms of the emulator; few are enough where they scatter less, in standard
deviations of the residuals."""
MOST_REGIONS = 8
RIVAL = 1.2
"""Rms of another optimum over that of the best one, below which it is reported."""
ROUNDS = 3
"""Estimates of the errors, each followed by a fit."""
SINGULAR = 1e-12
"""Least eigenvalue of what the data know, of the greatest."""
LEAST_NOISE = 1e-6
"""Noise at least, of the range of the values."""
LEAST_SPARE = 0.2
"""Share of a worm that its emulator leaves free, at least."""


@dataclass(frozen=True)
class Part:
    """One experiment of a fit.

    Attributes:
        experiment: As fitted.
        data: The points that are fitted.
        held: Those that are held out.
        fitted: Prediction of the points, ``(n,)``.
        held_fitted: Of those held out.
        smooth: Prediction of the points by the emulator at its optimum.
        jacobian: Change of a prediction for a relative change of each parameter, ``(n, p)``.
        held_jacobian: Of those held out.
        noise: Errors of the points.
        scatter: Covariance of worms about the emulator, ``(n, n)``.
        held_scatter: Variance of the same of the points held out.
        floor: Standard deviation of the noise of the points as far as it is known without the fit, ``(n,)``.
        numbers: Further numbers, by name.
        doubts: What is wrong with the data, a sentence each.
    """

    experiment: Experiment
    data: Data
    held: Data
    fitted: Array
    held_fitted: Array
    smooth: Array
    jacobian: Array
    held_jacobian: Array
    noise: Noise
    scatter: Array
    held_scatter: Array
    floor: Array | None
    numbers: dict[str, float]
    doubts: list[str]

    @property
    def is_fitted(self) -> bool:
        """Whether any of its points are fitted."""
        return len(self.data.at) > 0

    @property
    def residual(self) -> Array:
        """Measured less fitted, ``(n,)``."""
        return self.data.values - self.fitted

    @cached_property
    def root(self) -> Array:
        """Lower root of the points' covariance about the emulator."""
        return self.noise.root(self.data, self.scatter)

    @property
    def rms(self) -> float:
        """Root mean square of the residuals; of the points held out where all are."""
        rest = self.residual if self.is_fitted else self.held.values - self.held_fitted
        return float(np.sqrt((rest**2).mean()))

    @property
    def information(self) -> Array:
        """What it knows of the parameters: inverse covariance of their logarithms, ``(p, p)``."""
        j = whitened(self.root, self.jacobian)
        return j.T @ j


@dataclass(frozen=True)
class Fit:
    """A fit.

    Attributes:
        study: The study.
        logs: Logarithms of the fitted parameters, of a worm that was computed, ``(p,)``.
        middle: Those of the emulator's optimum, about which the intervals lie.
        emulator: Of the worms about the fitted one.
        parts: The experiments.
        rival: Another worm, far from it, that fits about as well: its logarithms, and its rms over the fitted one's.
        prior: Residuals of the priors at the middle and their derivatives, ``(k,)`` and ``(k, p)``.
        n_tests: Tests of worms that were computed.
    """

    study: IdentifyStudy
    logs: Array
    middle: Array
    emulator: Emulator
    parts: tuple[Part, ...]
    rival: tuple[Array, float] | None
    prior: tuple[Array, Array]
    n_tests: int

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, ``(p,)``."""
        return tuple(self.study.parameters)

    @property
    def values(self) -> dict[str, float]:
        """The fitted values by name."""
        return dict(zip(self.names, np.exp(self.logs).tolist(), strict=True))

    @cached_property
    def information(self) -> Array:
        """Inverse covariance of the logarithms of the parameters, ``(p, p)``."""
        return sum((part.information for part in self.parts), self.prior[1].T @ self.prior[1])

    @cached_property
    def from_noise(self) -> Array:
        """Covariance of the logarithms by the errors of the points; what the data say nothing of has a huge one."""
        return inverse(self.information)

    @cached_property
    def from_scatter(self) -> Array:
        """The same by the scatter of worms: each is fitted as if it were the robot, by an emulator without it."""
        off, leverage = self.emulator.off
        errors = np.zeros((len(leverage), len(self.middle)))
        for number in range(len(leverage)):
            # The weights must not know the worm that they are tried on.
            others = np.arange(len(leverage)) != number
            information, pull = self.prior[1].T @ self.prior[1], np.zeros(len(self.middle))
            for part, rows, held in zip(self.parts, off, self.emulator.model.rows, strict=True):
                own = rows[:, ~held]
                scatter = own[others].T @ own[others] / max(self.emulator.spare - 1, 1)
                root = part.noise.root(part.data, scatter)
                j = whitened(root, part.jacobian)
                information = information + j.T @ j
                pull = pull + j.T @ whitened(root, own[number]) / max(1.0 - leverage[number], LEAST_SPARE)
            errors[number] = inverse(information) @ pull
        return errors.T @ errors / len(errors)

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the logarithms of the parameters, ``(p, p)``."""
        return self.from_noise + self.from_scatter

    @property
    def at_bound(self) -> tuple[str, ...]:
        """Parameters that ended at a bound, so that their value is the bound's and not the data's."""
        known = self.study.parameters.items()
        return tuple(n for n, one in known if not 1.01 * one.low < self.values[n] < 0.99 * one.high)


def inverse(information: Array) -> Array:
    """Returns the covariance, ``(p, p)``, that belongs to an information, huge where there is none."""
    values, vectors = np.linalg.eigh(information)
    return (vectors / np.maximum(values, SINGULAR * max(values[-1], 1.0))) @ vectors.T


def points_at(data: Data, rows: np.ndarray) -> Data:
    """Returns some points of an experiment."""
    return replace(data, at=data.at[rows], values=data.values[rows], series=data.series[rows])


def prior_rows(study: IdentifyStudy, logs: Array) -> tuple[Array, Array]:
    """Residuals of the priors in standard deviations, ``(k,)``, and their derivatives, ``(k, p)``."""
    rows = [
        (*one.prior.row(float(logs[i])), i) for i, one in enumerate(study.parameters.values()) if one.prior is not None
    ]
    jacobian = np.zeros((len(rows), len(logs)))
    for row, (_, slope, i) in enumerate(rows):
        jacobian[row, i] = slope
    return np.array([row[0] for row in rows]), jacobian


class Errors:
    """Errors of the fitted points of all experiments, and the misfit that they weigh."""

    def __init__(self, model: Model, noises: Sequence[Noise], scatter: Sequence[Array] | None = None) -> None:
        """Takes the noise of each experiment and perhaps the scatter of worms about the emulator."""
        self.model, self.noises = model, list(noises)
        self.kept = [points_at(data, ~held) for data, held in zip(model.data, model.rows, strict=True)]
        spread = [None] * len(noises) if scatter is None else scatter
        self._roots = [
            noise.root(data, None if own is None else own[np.ix_(~held, ~held)])
            for noise, data, own, held in zip(noises, self.kept, spread, model.rows, strict=True)
        ]

    def rows(self, logs: Array, predicted: Sequence[Array]) -> Array:
        """Residuals in standard deviations, with those of the priors, ``(n,)``."""
        parts = zip(self._roots, self.kept, predicted, self.model.rows, strict=True)
        own = [whitened(root, one[~held] - data.values) for root, data, one, held in parts]
        return np.concatenate([*own, prior_rows(self.model.study, logs)[0]])

    def misfit(self, one: Tried) -> float:
        """Sum of squares of a worm that was computed."""
        return float((self.rows(one.logs, self.model.measured(one)) ** 2).sum())

    def minimise(self, emulator: Emulator, start: Array, low: Array, high: Array) -> Array:
        """Returns the emulator's optimum between bounds."""
        # Loading it takes a second, which only a fit should pay.
        from scipy.optimize import least_squares

        return least_squares(
            lambda at: self.rows(at, emulator.predicted(at)),
            np.clip(start, low + 1e-9, high - 1e-9),
            bounds=(low, high),
            x_scale=np.where(np.isfinite(emulator.radius), emulator.radius, 0.1),
            diff_step=1e-4,
            xtol=1e-4,
            ftol=1e-6,
            max_nfev=30,
        ).x


def plain(model: Model, one: Tried) -> Errors:
    """Independent errors of the size of a worm's residuals: no discrepancy explains a bad fit away."""
    noises = []
    for own, data, held, there in zip(
        model.study.experiments, model.data, model.rows, model.measured(one), strict=True
    ):
        rest = (data.values - there)[~held]
        size = sqrt(float((rest**2).sum()) / max(len(rest), 1))
        noises.append(Noise(max(size, own.noise_sd or 0.0, LEAST_NOISE * float(np.ptp(data.values)))))
    return Errors(model, noises)


def fitted(study: IdentifyStudy, folder: Path, simulations: Simulations) -> tuple[Fit, Model]:
    """Fits a study whose data lie in a folder.

    Raises:
        ConfigError: The data do not fit the experiments, or are too few.
        SimulationStopped: The worm that the fit starts from gives way.
    """
    model = Model(study, folder, simulations)
    first = model.run([model.start])[0]
    if first is None:
        raise SimulationStopped("the worm that the fit starts from gives way: set the parameters' start otherwise")
    for one, data, found, there in zip(study.experiments, model.data, first.found, model.measured(first), strict=True):
        one.refuse_unlike(data, found, there)
    return _finished(model, *_with_rival(model, *_searched(model, first, FIRST))), model


def _searched(model: Model, best: Tried, first: float) -> tuple[Tried, Emulator]:
    """Finds the region of the best fit from a worm and a radius on: returns the best worm and the region's emulator."""
    from scipy.stats import qmc

    moving, quadratic = model.moving, n_terms(len(model.moving), 2)
    is_moving = np.isin(np.arange(len(model.start)), moving)
    centre, radius = best.logs, np.where(is_moving, first, np.inf)
    draw = qmc.Halton(max(len(moving), 1), rng=2026)
    last, was_fine, wanted, before = not moving, False, 2 * quadratic, np.full(len(model.start), np.inf)
    for _ in range(MOST_REGIONS):
        low, high = np.maximum(centre - radius, model.low), np.minimum(centre + radius, model.high)
        inside = [one for one in model.tried if (np.abs(one.logs - centre) <= radius)[moving].all()]
        if moving and (missing := wanted - len(inside)) > 0:
            many = np.tile(centre, (missing, 1))
            many[:, moving] = low[moving] + draw.random(missing) * (high - low)[moving]
            model.run(list(many))
        best = _best(model, plain(model, best), best)
        if last:
            break
        emulator = _emulator(model, centre, radius, quadratic + 2)
        errors = Errors(model, plain(model, best).noises, emulator.scatter())
        optimum = errors.minimise(emulator, best.logs, low, high)
        model.run([optimum])
        best = _best(model, plain(model, best), replace(best, logs=model.with_untested(best, optimum).logs))
        share, clear, known = _goal(model, emulator, best)
        # A region in which worms scatter too much to show any slope is too wide.
        is_open = (known >= radius) & bool(share <= 1.0 or (known < radius)[moving].any())
        goal = clear + known
        # Scatter that hardly falls with the region is that of any worm. Once an emulator is as good as the fit, one
        # smaller region shows whether it is.
        is_rough = bool((clear > ROUGH * before)[moving].all())
        is_small = bool((goal <= radius)[moving].all())
        edge = ~is_open & (np.abs(best.logs - centre) > 0.8 * radius)
        is_fine = share <= 1.0
        last = not edge.any() and bool(
            is_open[moving].all() or (is_fine and was_fine) or (is_small and (is_fine or is_rough))
        )
        was_fine, before = is_fine, clear
        centre = best.logs
        goal = np.clip(goal, radius * SHRINK**2, radius) if last else np.where(is_open, radius, radius * SHRINK)
        radius = np.where(is_moving, np.where(edge, radius, goal), np.inf)
        wanted = LAST * quadratic if last and share > SMOOTH else quadratic + 2
    return best, _emulator(model, centre, radius, quadratic + 2)


def _with_rival(model: Model, best: Tried, emulator: Emulator) -> tuple[Tried, Emulator, tuple[Array, float] | None]:
    """Looks for another optimum, from the best worm of the first region that no slope joins with the best one.

    Returns:
        The better of both with its emulator, and the other one, if there is one that fits about as well.
    """
    moving, errors = model.moving, plain(model, best)
    design = model.tried[: 1 + 2 * n_terms(len(moving), 2)]
    away = [np.abs(one.logs - best.logs)[moving].max(initial=0.0) > FIRST / 2 for one in design]
    far = [model.with_untested(one, best.logs) for one, is_far in zip(design, away, strict=True) if is_far]
    if not far:
        return best, emulator, None
    other = min(far, key=errors.misfit)
    between = model.run([(other.logs + best.logs) / 2.0])[0]
    if between is None or errors.misfit(between) < errors.misfit(other):
        return best, emulator, None
    kept, model.tried = model.tried, [other]
    found, emulator_there = _searched(model, other, FIRST * SHRINK)
    ratio = float(np.sqrt(errors.misfit(found) / errors.misfit(best)))
    is_far = np.abs(found.logs - best.logs)[moving].max() > FIRST * SHRINK
    if is_far and ratio < 1.0:
        return found, emulator_there, (best.logs, 1.0 / ratio) if 1.0 / ratio < RIVAL else None
    model.tried = kept
    return best, emulator, (found.logs, ratio) if is_far and ratio < RIVAL else None


def _goal(model: Model, emulator: Emulator, best: Tried) -> tuple[float, Array, Array]:
    """Returns how far worms scatter about an emulator, in standard deviations of the residuals, and two radii.

    In the first, ``(p,)``, every parameter moves the points clearly farther than worms scatter; in the second, the data
    leave it open.
    """
    all_parts = zip(
        plain(model, best).noises, emulator.derivatives(best.logs), emulator.scatter(), model.rows, strict=True
    )
    fitted = [(noise.noise, j[~held], np.diag(s)[~held]) for noise, j, s, held in all_parts if not held.all()]
    sizes, slopes = [size for size, _, _ in fitted], [j for _, j, _ in fitted]
    off = np.sqrt(max(scatter.mean() / size**2 for size, _, scatter in fitted))
    moves = np.mean([(j**2).mean(axis=0) / size**2 for j, size in zip(slopes, sizes, strict=True)], axis=0)
    rows = np.concatenate([j / size for j, size in zip(slopes, sizes, strict=True)])
    return float(off), CLEAR * off / np.sqrt(np.maximum(moves, 1e-12)), REACH * np.sqrt(np.diag(inverse(rows.T @ rows)))


def _best(model: Model, errors: Errors, one: Tried) -> Tried:
    """The best of the worms that were computed, with the parameters of one that no test depends on."""
    return min((model.with_untested(other, one.logs) for other in model.tried), key=errors.misfit)


def _emulator(model: Model, centre: Array, radius: Array, fewest: int) -> Emulator:
    """An emulator of the worms in a region, or of the nearest ones where it has too few."""
    m = model.moving
    away = [np.abs((one.logs - centre) / radius)[m].max(initial=0.0) for one in model.tried]
    near = np.argsort(away, kind="stable")
    inside = max(sum(one <= 1.0 + 1e-9 for one in away), fewest if m else 1)
    return Emulator(model, [model.tried[i] for i in near[:inside]], centre, radius)


def _finished(model: Model, best: Tried, emulator: Emulator, rival: tuple[Array, float] | None) -> Fit:
    """Finds the errors of the points and the optimum in the last region, in turn."""
    scatter, errors = emulator.scatter(), plain(model, best)
    low = np.maximum(emulator.centre - 1.5 * emulator.radius, model.low)
    high = np.minimum(emulator.centre + 1.5 * emulator.radius, model.high)
    middle, noises = best.logs, errors.noises
    for _ in range(ROUNDS):
        middle = Errors(model, noises, scatter).minimise(emulator, middle, low, high)
        noises = _errors(_fit_of(model, emulator, best, middle, noises, scatter))
    model.run([middle, *_finish(_fit_of(model, emulator, best, middle, noises, scatter), low, high)])
    best = _best(model, Errors(model, noises), replace(best, logs=middle))
    return replace(_fit_of(model, emulator, best, middle, noises, scatter), rival=rival)


def _finish(fit: Fit, low: Array, high: Array) -> list[Array]:
    """Draws worms from what the data leave open, where worms scatter: one of them may lie nearer than the middle."""
    from scipy.stats import norm, qmc

    moving = fit.emulator.model.moving
    rough = (float(np.diag(p.scatter).mean()) / p.noise.noise**2 for p in fit.parts if p.is_fitted)
    if not moving or max(rough) < SMOOTH**2:
        return []
    shares = qmc.Halton(len(moving), rng=2027).random(2 * n_terms(len(moving), 2))
    spread = np.linalg.cholesky(fit.covariance[np.ix_(moving, moving)])
    many = np.tile(fit.middle, (len(shares), 1))
    many[:, moving] += norm.ppf(shares) @ spread.T
    return list(np.clip(many, low, high))


def _fit_of(
    model: Model, emulator: Emulator, best: Tried, middle: Array, noises: Sequence[Noise], scatter: Sequence[Array]
) -> Fit:
    experiments = [one for _, one in model.worms(best.logs)]
    fitted, smooth = model.measured(best), emulator.predicted(middle)
    slopes = emulator.derivatives(middle)
    floors = [one.noise_floor(data) for one, data in zip(experiments, model.data, strict=True)]
    parts = tuple(
        Part(
            experiments[e],
            points_at(data, ~held),
            points_at(data, held),
            fitted[e][~held],
            fitted[e][held],
            smooth[e][~held],
            slopes[e][~held],
            slopes[e][held],
            noises[e],
            scatter[e][np.ix_(~held, ~held)],
            np.diag(scatter[e])[held],
            None if floor is None else floor[~held],
            experiments[e].numbers(data, best.found[e]),
            experiments[e].doubts(data, best.found[e]),
        )
        for e, (data, held, floor) in enumerate(zip(model.data, model.rows, floors, strict=True))
    )
    prior = prior_rows(model.study, middle)
    return Fit(model.study, best.logs, middle, emulator, parts, None, prior, model.simulations.computed)


def _errors(fit: Fit) -> list[Noise]:
    """Estimates the errors of every experiment from the residuals at the emulator's optimum.

    One that is held out has those of the first fitted one of its kind and unit, or no discrepancy, and its own noise.
    """
    prior = fit.prior[1].T @ fit.prior[1]
    found: dict[str, Noise] = {}
    for part in fit.parts:
        if part.is_fitted:
            known = sum((other.information for other in fit.parts if other is not part), prior)
            rest, stated = part.data.values - part.smooth, part.experiment.noise_sd
            noise = estimated(part.data, rest, part.jacobian, known, stated, part.scatter)
            found[part.experiment.name] = noise
    return [found.get(part.experiment.name) or _held_out(fit, part, found) for part in fit.parts]


def _held_out(fit: Fit, part: Part, found: Mapping[str, Noise]) -> Noise:
    own = Noise(part.experiment.noise_held_out(part.held))
    for other in fit.parts:
        if other.is_fitted and (other.experiment.kind, other.data.unit) == (part.experiment.kind, part.data.unit):
            noise = found[other.experiment.name]
            return noise if part.experiment.noise_sd is None else replace(noise, noise=own.noise)
    return own
