"""The optimisers: each asks for a generation of values and is told their scores, of which less is better."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from math import floor, log
from typing import TYPE_CHECKING, Any

import numpy as np

from annelid.errors import MissingDependency
from annelid.experiment.space import Choice, Interval, Variable, from_unit, to_unit
from annelid.morphology import Array

if TYPE_CHECKING:
    import optuna

FIRST_SPREAD = 0.2
"""Standard deviation of a CMA-ES's first generation, in shares of a variable's range."""

Values = Mapping[str, Any]
MISSING = "tuning needs Optuna and cmaes: install them with  pip install 'annelid[tune]'"


def optimiser_of(variables: Sequence[Variable], n_objectives: int, own: Values | None, seed: int) -> CmaEs | Parzen:
    """Returns the optimiser that suits a search.

    Args:
        variables: What is varied.
        n_objectives: 1 or 2.
        own: Values to start from; None for the middle of every range.
        seed: Of the optimiser.

    Returns:
        A CMA-ES for one objective over at least two numbers, else a Parzen estimator.

    Raises:
        MissingDependency: Optuna or cmaes is not installed.
    """
    intervals = [variable for variable in variables if isinstance(variable, Interval)]
    if n_objectives == 1 and len(intervals) == len(variables) > 1:
        return CmaEs(intervals, own, seed)
    return Parzen(variables, n_objectives, own, seed)


def generation_size(n_variables: int) -> int:
    """Returns how many gaits are asked for at once: the usual population of a CMA-ES, made even, at least 8."""
    return max(8, 2 * floor((5 + 3 * log(n_variables)) / 2))


class CmaEs:
    """Covariance matrix adaptation (Hansen 2016), as the package cmaes has it, over the unit cube of the ranges."""

    def __init__(self, variables: Sequence[Interval], own: Values | None, seed: int) -> None:
        """Begins.

        Args:
            variables: What is varied, at least two.
            own: Values to start from; None for the middle of every range.
            seed: Of the random numbers.

        Raises:
            MissingDependency: cmaes is not installed.
        """
        try:
            from cmaes import CMA
        except ImportError:
            raise MissingDependency(MISSING) from None
        self._variables = variables
        start = [0.5 if own is None else to_unit(one, own[one.field]) for one in variables]
        self._cma = CMA(
            mean=np.array(start),
            sigma=FIRST_SPREAD,
            bounds=np.array([[0.0, 1.0]] * len(variables)),
            population_size=generation_size(len(variables)),
            seed=seed,
        )
        self._asked: list[Array] = []

    def ask(self) -> list[dict[str, Any]]:
        """Returns the values of the next generation, by field."""
        self._asked = [self._cma.ask() for _ in range(self._cma.population_size)]
        return [
            {one.field: from_unit(one, float(share)) for one, share in zip(self._variables, point, strict=True)}
            for point in self._asked
        ]

    def tell(self, scores: Sequence[tuple[float, ...]]) -> None:
        """Takes the scores of the generation that was asked for last; fewer of them end the search."""
        if len(scores) == len(self._asked):
            self._cma.tell([(point, score) for point, (score,) in zip(self._asked, scores, strict=True)])


class Parzen:
    """Optuna's multivariate tree-structured Parzen estimator (Bergstra 2011): any variables, one objective or two."""

    def __init__(self, variables: Sequence[Variable], n_objectives: int, own: Values | None, seed: int) -> None:
        """Begins.

        Args:
            variables: What is varied.
            n_objectives: 1 or 2.
            own: Values that the first trial has; None for a drawn one.
            seed: Of the random numbers.

        Raises:
            MissingDependency: Optuna is not installed.
        """
        try:
            import optuna
        except ImportError:
            raise MissingDependency(MISSING) from None
        optuna.logging.set_verbosity(optuna.logging.ERROR)
        self._variables = variables
        self._size = generation_size(len(variables))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            sampler = optuna.samplers.TPESampler(
                seed=seed, n_startup_trials=2 * self._size, multivariate=True, constant_liar=True
            )
        self._study = optuna.create_study(
            sampler=sampler, directions=[optuna.study.StudyDirection.MINIMIZE] * n_objectives
        )
        if own is not None:
            self._study.enqueue_trial(
                {
                    one.field: one.values.index(own[one.field]) if isinstance(one, Choice) else own[one.field]
                    for one in variables
                }
            )
        self._asked: list[optuna.Trial] = []

    def ask(self) -> list[dict[str, Any]]:
        """Returns the values of the next generation, by field."""
        self._asked = [self._study.ask() for _ in range(self._size)]
        return [{one.field: _suggested(trial, one) for one in self._variables} for trial in self._asked]

    def tell(self, scores: Sequence[tuple[float, ...]]) -> None:
        """Takes the scores of the generation that was asked for last, in its order."""
        for trial, score in zip(self._asked, scores, strict=False):
            self._study.tell(trial, score)


def _suggested(trial: optuna.Trial, variable: Variable) -> Any:
    if isinstance(variable, Choice):
        # Optuna takes plain values only, and a choice may be a list.
        return variable.values[trial.suggest_categorical(variable.field, range(len(variable.values)))]
    if variable.whole:
        return trial.suggest_int(variable.field, int(variable.low), int(variable.high), log=variable.logarithmic)
    return variable.rounded(trial.suggest_float(variable.field, variable.low, variable.high, log=variable.logarithmic))
