"""What worms of other parameters give in the experiments of a study: by simulation, or by a local emulator of it.

A run is no smooth function of the parameters: a sensor that switches one step of the body later moves all that follows.
So nothing is differentiated over small steps. Runs spread over a region are fitted by a quadratic in the logarithms of
the parameters, sample by sample (least squares); how far they scatter about it is an error of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from annelid.config import RunConfig, check_section, load_config
from annelid.errors import ConfigError
from annelid.protocols import Array
from annelid_lab.calibration.base import Experiment, Found
from annelid_lab.calibration.simulations import Simulations
from annelid_lab.calibration.study import IdentifyStudy

NUDGE = 0.01
"""Relative change that shows whether a test depends on a parameter."""
STEP = 1e-3
"""Relative step of the derivatives of an emulator, which is smooth."""
EFFECT = 4.0
"""Least F ratio of a parameter's terms in an emulator: what moves worms less than they scatter is left out."""


@dataclass(frozen=True)
class Tried:
    """A worm whose tests were computed.

    Attributes:
        logs: Logarithms of its parameters, ``(p,)``.
        found: What its tests gave, experiment by experiment.
    """

    logs: Array
    found: list[Found]


class Model:
    """Predicts the points of all experiments from values of the parameters.

    Attributes:
        study: The study.
        data: Of the experiments.
        rows: Which points of each are held out.
        low: Logarithms of the lower bounds, ``(p,)``.
        high: Of the upper bounds.
        tried: Worms whose tests were computed.
        active: Numbers of the parameters that each experiment's test depends on.
        moving: Numbers of the parameters that any test depends on.
    """

    def __init__(self, study: IdentifyStudy, folder: Path, simulations: Simulations) -> None:
        """Reads the data of a study in a folder."""
        self.study, self.simulations, self.worm = study, simulations, study.worm(folder)
        self.data = [one.read(folder) for one in study.experiments]
        self.rows = [one.held(data) for one, data in zip(study.experiments, self.data, strict=True)]
        out = {one.name for one, held in zip(study.experiments, self.rows, strict=True) if held.all()}
        if len(out) == len(study.experiments):
            raise ConfigError("hold_out leaves nothing to fit: at least one experiment must be fitted")
        for name, one in study.parameters.items():
            paths = [path.split(".") for field in one.fields for path in study.paths(field)]
            if all(first == "experiments" and own in out for first, own, *_ in paths):
                raise ConfigError(
                    f"parameters.{name} is only of an experiment that is held out: leave it out of the study, or name "
                    "all others with --free"
                )
        n_fitted = sum(int((~held).sum()) for held in self.rows)
        if n_fitted <= len(study.parameters):
            raise ConfigError(f"{n_fitted} points cannot fit {len(study.parameters)} parameters")
        known = study.parameters.values()
        self.low, self.high = np.log([one.low for one in known]), np.log([one.high for one in known])
        self.start = np.log([one.start for one in known])
        self._fields = [
            {path: share for field, share in one.fields.items() for path in study.paths(field)} for one in known
        ]
        self.tried: list[Tried] = []
        # What a test gave is kept with its prediction, so that no other takes its identity.
        self._predicted: dict[tuple[int, bytes], tuple[list[Found], list[Array]]] = {}
        inward = np.where(self.start + NUDGE < self.high, NUDGE, -NUDGE)
        here = self._asked(self.start)
        there = [self._asked(self.start + inward * axis) for axis in np.eye(len(inward))]
        self.active = [
            [i for i, asked in enumerate(there) if asked[e] != one] if one is not None else []
            for e, one in enumerate(here)
        ]
        self.moving = sorted({i for own in self.active for i in own})

    def worms(self, logs: Array) -> list[tuple[RunConfig, Experiment]]:
        """Returns every experiment with its worm for logarithms of the parameters, ``(p,)``."""
        changes: dict[str, float] = {}
        for fields, value in zip(self._fields, np.exp(logs).tolist(), strict=True):
            changes |= {path: share * value for path, share in fields.items()}
        worm: dict[str, Any] = {p: value for p, value in changes.items() if not p.startswith("experiments.")}
        own: list[dict[str, float]] = [
            {p.rsplit(".", 1)[1]: v for p, v in changes.items() if p.startswith(f"experiments.{one.name}.")}
            for one in self.study.experiments
        ]
        base = self.worm.model_dump(exclude_none=True)
        same = load_config(base, worm)
        return [
            (
                load_config(base, {**one.set, **worm}) if one.set else same,
                check_section(type(one), one.model_dump() | its) if its else one,
            )
            for one, its in zip(self.study.experiments, own, strict=True)
        ]

    def run(self, many: Sequence[Array], stage: str = "identifying") -> list[Tried | None]:
        """Computes the tests of several worms, all at once, and keeps them; None for a worm that gives way."""
        wanted = []
        for logs in many:
            pairs = zip(self.worms(logs), self.data, strict=True)
            wanted += [(one.test(config, data), config) for (config, one), data in pairs]
        done = iter(self.simulations.compute([(t, c) for t, c in wanted if t is not None], stage))
        results = [{} if test is None else next(done) for test, _ in wanted]
        n, given = len(self.data), list[Tried | None]()
        for number, logs in enumerate(many):
            found = [one for one in results[number * n : (number + 1) * n] if one is not None]
            given.append(Tried(logs, found) if len(found) == n else None)
        self.tried += [one for one in given if one is not None]
        return given

    def predicted(self, logs: Array, found: Sequence[Found]) -> list[Array]:
        """Predicts all points of a worm from what its tests gave."""
        each = zip(self.worms(logs), self.data, found, strict=True)
        return [one.predicted(config, data, what) for (config, one), data, what in each]

    def measured(self, one: Tried) -> list[Array]:
        """Predicts all points of a worm that was computed."""
        key = (id(one.found), one.logs.tobytes())
        if key not in self._predicted:
            self._predicted[key] = one.found, self.predicted(one.logs, one.found)
        return self._predicted[key][1]

    def with_untested(self, tried: Tried, logs: Array) -> Tried:
        """Returns a worm that was computed with those parameters of another that no test depends on."""
        mixed = logs.copy()
        mixed[self.moving] = tried.logs[self.moving]
        return Tried(mixed, tried.found)

    def _asked(self, logs: Array) -> list[tuple[str, str] | None]:
        """What the tests of a worm depend on; None where there is no test."""
        worms = self.worms(logs)
        tests = [one.test(config, data) for (config, one), data in zip(worms, self.data, strict=True)]
        return [
            None if test is None else (repr(test), config.model_dump_json())
            for test, (config, _) in zip(tests, worms, strict=True)
        ]


class Emulator:
    """What the worms of a region give, by polynomials fitted to those that were computed there."""

    def __init__(self, model: Model, used: Sequence[Tried], centre: Array, radius: Array) -> None:
        """Fits them.

        Args:
            model: The experiments.
            used: Worms that were computed.
            centre: Logarithms of the parameters in the middle of the region, ``(p,)``.
            radius: Of the region, ``(p,)``.
        """
        self.model, self.used, self.centre, self.radius = model, used, centre, radius
        self._fits: list[tuple[list[int], int, Mapping[str, Any]]] = []
        self.spare = len(used)
        points = [model.measured(model.with_untested(one, centre)) for one in used]
        for e, active in enumerate(model.active):
            order = 2 if len(used) >= n_terms(len(active), 2) + 2 else int(len(used) > len(active) + 1)
            values = {
                name: np.stack([one.found[e][name].ravel() for one in used])
                for name, first in used[0].found[e].items()
                if first.dtype.kind == "f"
            }
            kept = [i for i in active if self._moves(np.stack([one[e] for one in points]), active, i, order)]
            terms = self._design(kept, order)
            self.spare = min(self.spare, len(used) - terms.shape[1])
            fits = {name: np.linalg.lstsq(terms, one, rcond=None)[0] for name, one in values.items()}
            self._fits.append((kept, order, fits))

    def _moves(self, points: Array, active: list[int], i: int, order: int) -> bool:
        """Whether a parameter moves the points of worms, ``(m, n)``, farther than they scatter."""
        whole, less = (self._design(some, order) for some in (active, [other for other in active if other != i]))
        if (spare := len(points) - whole.shape[1]) < 1:
            return True
        scatter, both = (
            float(((points - terms @ np.linalg.lstsq(terms, points, rcond=None)[0]) ** 2).sum())
            for terms in (whole, less)
        )
        return both - scatter > EFFECT * (whole.shape[1] - less.shape[1]) * scatter / spare

    def _design(self, active: list[int], order: int) -> Array:
        """Terms of all worms, ``(m, k)``."""
        return np.stack([self._terms(one.logs, active, order) for one in self.used])

    def _terms(self, logs: Array, active: list[int], order: int) -> Array:
        z = ((logs - self.centre) / self.radius)[active]
        rows, columns = np.triu_indices(len(z))
        return np.concatenate([[1.0], *([z] if order else []), *([z[rows] * z[columns]] if order > 1 else [])])

    def predicted(self, logs: Array) -> list[Array]:
        """Predicts all points of a worm."""
        found: list[Found] = []
        for e, (kept, order, fits) in enumerate(self._fits):
            first, terms = self.used[0].found[e], self._terms(logs, kept, order)
            found.append({n: (terms @ fits[n]).reshape(one.shape) if n in fits else one for n, one in first.items()})
        return self.model.predicted(logs, found)

    def derivatives(self, logs: Array) -> list[Array]:
        """Returns the change of every prediction for a relative change of each parameter, ``(n, p)``."""
        ends = [[self.predicted(logs + sign * STEP * axis) for sign in (1.0, -1.0)] for axis in np.eye(len(logs))]
        return [
            np.stack([(ahead[e] - behind[e]) / (2.0 * STEP) for ahead, behind in ends], axis=-1)
            for e in range(len(self.model.data))
        ]

    @cached_property
    def off(self) -> tuple[list[Array], Array]:
        """Worms less emulator, ``(m, n)`` by experiment, and the leverage of each worm, ``(m,)``."""
        rows = [
            [actual - smooth for actual, smooth in zip(self.model.measured(one), self.predicted(one.logs), strict=True)]
            for one in self.used
        ]
        leverage = np.zeros(len(self.used))
        for kept, order, fits in self._fits:
            if fits:
                terms = self._design(kept, order)
                leverage = np.maximum(leverage, np.diag(terms @ np.linalg.pinv(terms)))
        return [np.stack(own) for own in zip(*rows, strict=True)], leverage

    def scatter(self) -> list[Array]:
        """Returns the covariance of the points of worms about the polynomials, ``(n, n)`` by experiment."""
        return [rows.T @ rows / max(self.spare, 1) for rows in self.off[0]]


def n_terms(variables: int, order: int) -> int:
    """How many terms a polynomial has."""
    return 1 + variables + (variables * (variables + 1) // 2 if order > 1 else 0)
