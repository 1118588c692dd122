"""Fits a worm's parameters to all experiments of a study at once.

Generalised least squares over logarithms of the parameters (`scipy.optimize.least_squares`, trust region reflective).
Fit and errors of the points (`noise`) are found in turn, since each needs the other. Derivatives are differences; the
tests of all parameters are computed together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from annelid.config import RunConfig, check_section, load_config
from annelid.errors import ConfigError, SimulationStopped
from annelid.protocols import Array
from annelid_lab.calibration.base import Data, Experiment, Found
from annelid_lab.calibration.noise import Noise, estimated, whitened
from annelid_lab.calibration.simulations import Simulations
from annelid_lab.calibration.study import IdentifyStudy

STEP = 0.04
"""Relative step of the derivatives, above the scatter of a mesh that buckles a little differently each time."""
SMALL_STEP = 1e-4
"""The same of closed forms, which do not scatter."""
MOST_EVALUATIONS = 12
"""Evaluations of the optimiser beside those for derivatives, for each estimate of the errors."""
ROUNDS = 3
"""Estimates of the errors, each followed by a fit."""
SINGULAR = 1e-12
"""Least eigenvalue of what the data know, of the greatest."""
FIRST_NOISE = 0.02
"""Noise that is assumed before any is known, of the range of the values."""
OFF_SCALE = 20.0
"""Data that are so many times as large or as small as the worm's have another unit than their columns say."""
FAILED = 1e3
"""Residual, in standard deviations, of a worm that gives way."""


@dataclass(frozen=True)
class Part:
    """One experiment of a fit.

    Attributes:
        experiment: As fitted.
        data: The points that are fitted.
        held: Those that are held out.
        fitted: Prediction of the points, ``(n,)``.
        held_fitted: Of those held out.
        jacobian: Change of a prediction for a relative change of each parameter, ``(n, p)``.
        held_jacobian: Of those held out.
        noise: Errors of the points.
        numbers: Further numbers, by name.
    """

    experiment: Experiment
    data: Data
    held: Data
    fitted: Array
    held_fitted: Array
    jacobian: Array
    held_jacobian: Array
    noise: Noise
    numbers: dict[str, float]

    @property
    def residual(self) -> Array:
        """Measured less fitted, ``(n,)``."""
        return self.data.values - self.fitted

    @cached_property
    def root(self) -> Array:
        """Lower root of the points' covariance."""
        return self.noise.root(self.data)

    @property
    def rms(self) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt((self.residual**2).mean()))

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
        logs: Logarithms of the fitted parameters, ``(p,)``.
        parts: The experiments.
        prior: Residuals of the priors and their derivatives, ``(k,)`` and ``(k, p)``.
        n_tests: Tests of worms that were computed.
    """

    study: IdentifyStudy
    logs: Array
    parts: tuple[Part, ...]
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
    def covariance(self) -> Array:
        """Covariance of the logarithms of the parameters, ``(p, p)``; what the data say nothing of has a huge one."""
        values, vectors = np.linalg.eigh(self.information)
        return (vectors / np.maximum(values, SINGULAR * values[-1])) @ vectors.T

    @property
    def at_bound(self) -> tuple[str, ...]:
        """Parameters that ended at a bound, so that their value is the bound's and not the data's."""
        known = self.study.parameters.items()
        return tuple(n for n, one in known if not 1.01 * one.low < self.values[n] < 0.99 * one.high)


class Model:
    """Predicts the points of all experiments from values of the parameters."""

    def __init__(self, study: IdentifyStudy, folder: Path, simulations: Simulations) -> None:
        """Reads the data of a study in a folder."""
        self.study, self.simulations, self.worm = study, simulations, study.worm(folder)
        self.data = [one.read(folder) for one in study.experiments]
        self.rows = [held_out(one, data) for one, data in zip(study.experiments, self.data, strict=True)]
        n_fitted = sum(int((~held).sum()) for held in self.rows)
        if n_fitted <= len(study.parameters):
            raise ConfigError(f"{n_fitted} points cannot fit {len(study.parameters)} parameters")
        self._slopes: list[tuple[Array, list[Array]]] = []

    def worms(self, logs: Array) -> tuple[RunConfig, list[Experiment]]:
        """Returns the worm and the experiments for logarithms of the parameters, ``(p,)``."""
        changes: dict[str, float] = {}
        for (_, one), value in zip(self.study.parameters.items(), np.exp(logs).tolist(), strict=True):
            for field, share in one.fields.items():
                for path in self.study.paths(field):
                    changes[path] = share * value
        worm: dict[str, Any] = {p: value for p, value in changes.items() if not p.startswith("experiments.")}
        own: list[dict[str, float]] = [
            {p.rsplit(".", 1)[1]: v for p, v in changes.items() if p.startswith(f"experiments.{one.name}.")}
            for one in self.study.experiments
        ]
        config = load_config(self.worm.model_dump(exclude_none=True), worm)
        return config, [
            check_section(type(one), one.model_dump() | its) if its else one
            for one, its in zip(self.study.experiments, own, strict=True)
        ]

    def found(self, many: Sequence[Array], stage: str) -> list[list[Found]]:
        """Computes what the tests of several worms give, all at once, in the order of the experiments."""
        wanted = []
        for logs in many:
            config, experiments = self.worms(logs)
            wanted += [(one.test(config, data), config) for one, data in zip(experiments, self.data, strict=True)]
        done = iter(self.simulations.compute([(t, c) for t, c in wanted if t is not None], stage))
        results: list[Found] = [{} if test is None else next(done) for test, _ in wanted]
        n = len(self.data)
        return [results[i : i + n] for i in range(0, len(results), n)]

    def predicted(self, many: Sequence[Array], stage: str = "identifying") -> list[list[Array]]:
        """Predicts all points of several worms, in the order of the experiments."""
        predicted: list[list[Array]] = []
        for logs, found in zip(many, self.found(many, stage), strict=True):
            config, experiments = self.worms(logs)
            pairs = zip(experiments, self.data, found, strict=True)
            predicted.append([one.predicted(config, data, what) for one, data, what in pairs])
        return predicted

    def derivatives(self, logs: Array) -> list[Array]:
        """Returns the change of every prediction for a relative change of each parameter, ``(n, p)``."""
        for at, known in self._slopes:
            # Differences over a step change less than that from so near a place.
            if np.abs(logs - at).max() <= STEP / 4:
                return known
        high = bounds(self.study)[1]
        steps = [STEP if logs[i] + STEP <= high[i] else -STEP for i in range(len(logs))]
        moved = [logs + step * axis for step, axis in zip(steps, np.eye(len(logs)), strict=True)]
        here, *there = self.predicted([logs, *moved])
        slopes = [
            np.stack([(one[part] - here[part]) / step for one, step in zip(there, steps, strict=True)], axis=-1)
            for part in range(len(self.data))
        ]
        slopes = [own if exact is None else exact for own, exact in zip(slopes, self._closed(logs), strict=True)]
        self._slopes.append((logs, slopes))
        return slopes

    def _closed(self, logs: Array) -> list[Array | None]:
        """Central differences of the experiments that need no test of a worm, by a small step; None for the others."""
        config, experiments = self.worms(logs)
        closed = [one.test(config, data) is None for one, data in zip(experiments, self.data, strict=True)]
        slopes: list[list[Array]] = [[] for _ in experiments]
        for axis in np.eye(len(logs)):
            ends = [self.worms(logs + sign * SMALL_STEP * axis) for sign in (1.0, -1.0)]
            for part, data in enumerate(self.data):
                if closed[part]:
                    ahead, behind = (own[part].predicted(worm, data, {}) for worm, own in ends)
                    slopes[part].append((ahead - behind) / (2.0 * SMALL_STEP))
        return [np.stack(own, axis=-1) if is_closed else None for own, is_closed in zip(slopes, closed, strict=True)]


def bounds(study: IdentifyStudy) -> tuple[Array, Array]:
    """Logarithms of the bounds of the parameters, ``(p,)`` each."""
    known = study.parameters.values()
    return np.log([one.low for one in known]), np.log([one.high for one in known])


def held_out(experiment: Experiment, data: Data) -> np.ndarray:
    """Which points of an experiment are held out, ``(n,)``."""
    place = (np.arange(len(data.at)) + 0.5) / len(data.at)
    held = np.zeros(len(place), dtype=bool)
    for low, high in experiment.hold_out:
        held |= (place >= low) & (place < high)
    if held.sum() > 0.8 * len(held):
        raise ConfigError(f"experiments.{experiment.name}.hold_out leaves {(~held).sum()} of {len(held)} points to fit")
    return held


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


def fitted(study: IdentifyStudy, folder: Path, simulations: Simulations) -> tuple[Fit, Model]:
    """Fits a study whose data lie in a folder.

    Raises:
        ConfigError: The data do not fit the experiments, or are too few.
        SimulationStopped: The worm that the fit starts from gives way.
    """
    # Loading it takes a second, which only a fit should pay.
    from scipy.optimize import least_squares

    model = Model(study, folder, simulations)
    logs = np.log([one.start for one in study.parameters.values()])
    low, high = bounds(study)
    _refuse_unlike(study, model, model.predicted([logs])[0])
    noises = [
        Noise(one.noise_sd or FIRST_NOISE * float(np.ptp(data.values)))
        for one, data in zip(study.experiments, model.data, strict=True)
    ]
    for left in reversed(range(ROUNDS + 1)):
        kept = [points_at(data, ~held) for data, held in zip(model.data, model.rows, strict=True)]
        roots = [noise.root(data) for noise, data in zip(noises, kept, strict=True)]

        def residual(at: Array, roots: list[Array] = roots, kept: list[Data] = kept) -> Array:
            try:
                there = model.predicted([at])[0]
            except SimulationStopped:
                return np.full(sum(len(one.at) for one in kept) + len(prior_rows(study, at)[0]), FAILED)
            rows = zip(roots, kept, there, model.rows, strict=True)
            own = [whitened(root, one[~held] - data.values) for root, data, one, held in rows]
            return np.concatenate([*own, prior_rows(study, at)[0]])

        def jacobian(at: Array, roots: list[Array] = roots) -> Array:
            pairs = zip(roots, model.derivatives(at), model.rows, strict=True)
            return np.concatenate([*(whitened(root, j[~held]) for root, j, held in pairs), prior_rows(study, at)[1]])

        found = least_squares(
            residual,
            np.clip(logs, low + 1e-9, high - 1e-9),
            bounds=(low, high),
            method="trf",
            jac=jacobian,  # pyright: ignore[reportArgumentType]
            max_nfev=MOST_EVALUATIONS,
            # Until the errors of the points are known, an exact optimum means little.
            xtol=1e-3 if left < ROUNDS else 1e-2,
            ftol=1e-4 if left < ROUNDS else 1e-2,
        )
        moved, logs = float(np.abs(found.x - logs).max()), found.x
        fit = _fit_of(model, logs, noises)
        if not left or (left < ROUNDS and moved < STEP / 10):
            break
        noises = _errors(fit)
    return _fit_of(model, logs, noises), model


def _fit_of(model: Model, logs: Array, noises: Sequence[Noise]) -> Fit:
    predicted, jacobians = model.predicted([logs])[0], model.derivatives(logs)
    experiments, found = model.worms(logs)[1], model.found([logs], "identifying")[0]
    parts: list[Part] = []
    for one, data, held, there, j, noise, what in zip(
        experiments, model.data, model.rows, predicted, jacobians, noises, found, strict=True
    ):
        numbers = one.numbers(data, what)
        parts.append(
            Part(
                one,
                points_at(data, ~held),
                points_at(data, held),
                there[~held],
                there[held],
                j[~held],
                j[held],
                noise,
                numbers,
            )
        )
    return Fit(model.study, logs, tuple(parts), prior_rows(model.study, logs), model.simulations.computed)


def _errors(fit: Fit) -> list[Noise]:
    """Estimates the errors of every experiment from a fit's residuals."""
    prior = fit.prior[1].T @ fit.prior[1]
    elsewhere = [sum((other.information for other in fit.parts if other is not part), prior) for part in fit.parts]
    return [
        estimated(part.data, part.residual, part.jacobian, known, part.experiment.noise_sd)
        for part, known in zip(fit.parts, elsewhere, strict=True)
    ]


def _refuse_unlike(study: IdentifyStudy, model: Model, predicted: Sequence[Array]) -> None:
    """Refuses data that the worm misses by orders of magnitude."""
    for one, data, there in zip(study.experiments, model.data, predicted, strict=True):
        sizes = [float(np.abs(values).max()) for values in (data.values, there)]
        if min(sizes) > 0 and not 1 / OFF_SCALE < sizes[0] / sizes[1] < OFF_SCALE:
            raise ConfigError(
                f"the data of experiments.{one.name} reach {sizes[0]:.3g} {data.unit}, the worm that the fit starts "
                f"from {sizes[1]:.3g} {data.unit}: is a unit wrong?"
            )
