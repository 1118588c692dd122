"""The optimisers: each yields a generation of values by field and is sent their scores, of which less is better."""

from __future__ import annotations

import warnings
from collections.abc import Generator, Mapping, Sequence
from math import floor, log
from typing import TYPE_CHECKING, Any

import numpy as np

from annelid.errors import MissingDependency
from annelid.experiment.space import Choice, Interval, Variable, from_unit, to_unit

if TYPE_CHECKING:
    import optuna

FIRST_SPREAD = 0.2
"""Standard deviation of a CMA-ES's first generation, in shares of a variable's range."""
MISSING = "tuning needs Optuna and cmaes: install them with  pip install 'annelid[tune]'"

Values = dict[str, Any]
Optimiser = Generator[list[Values], Sequence[tuple[float, ...]], None]


def optimiser_of(
    variables: Sequence[Variable], n_objectives: int, own: Mapping[str, Any] | None, seed: int
) -> Optimiser:
    """Returns a CMA-ES for one objective over at least two numbers, else a Parzen estimator.

    It starts from the field's own values; without any from the middle of every range, or a drawn value.
    """
    intervals = [variable for variable in variables if isinstance(variable, Interval)]
    if n_objectives == 1 and len(intervals) == len(variables) > 1:
        return cma_es(intervals, own, seed)
    return parzen(variables, n_objectives, own, seed)


def generation_size(n_variables: int) -> int:
    """Returns how many gaits are asked for at once: the usual population of a CMA-ES, made even, at least 8."""
    return max(8, 2 * floor((5 + 3 * log(n_variables)) / 2))


def cma_es(variables: Sequence[Interval], own: Mapping[str, Any] | None, seed: int) -> Optimiser:
    """Covariance matrix adaptation (Hansen 2016), as the package cmaes has it, over the unit cube of the ranges."""
    try:
        from cmaes import CMA
    except ImportError:
        raise MissingDependency(MISSING) from None
    cma = CMA(
        mean=np.array([0.5 if own is None else to_unit(one, own[one.field]) for one in variables]),
        sigma=FIRST_SPREAD,
        bounds=np.array([[0.0, 1.0]] * len(variables)),
        population_size=generation_size(len(variables)),
        seed=seed,
    )
    while True:
        points = [cma.ask() for _ in range(cma.population_size)]
        scores = yield [
            {one.field: from_unit(one, float(share)) for one, share in zip(variables, point, strict=True)}
            for point in points
        ]
        cma.tell([(point, score) for point, (score,) in zip(points, scores, strict=True)])


def parzen(variables: Sequence[Variable], n_objectives: int, own: Mapping[str, Any] | None, seed: int) -> Optimiser:
    """Optuna's multivariate tree-structured Parzen estimator (Bergstra 2011): any variables, one objective or two."""
    try:
        import optuna
    except ImportError:
        raise MissingDependency(MISSING) from None
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    size = generation_size(len(variables))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        sampler = optuna.samplers.TPESampler(
            seed=seed, n_startup_trials=2 * size, multivariate=True, constant_liar=True
        )
    minimize = optuna.study.StudyDirection.MINIMIZE
    study = optuna.create_study(sampler=sampler, directions=[minimize] * n_objectives)
    if own is not None:
        study.enqueue_trial(
            {
                one.field: one.values.index(own[one.field]) if isinstance(one, Choice) else own[one.field]
                for one in variables
            }
        )
    while True:
        trials = [study.ask() for _ in range(size)]
        scores = yield [{one.field: _suggested(trial, one) for one in variables} for trial in trials]
        for trial, score in zip(trials, scores, strict=True):
            study.tell(trial, score)


def _suggested(trial: optuna.Trial, variable: Variable) -> Any:
    if isinstance(variable, Choice):
        # Optuna takes plain values only, and a choice may be a list.
        return variable.values[trial.suggest_categorical(variable.field, range(len(variable.values)))]
    if variable.whole:
        return trial.suggest_int(variable.field, int(variable.low), int(variable.high), log=variable.logarithmic)
    return variable.rounded(trial.suggest_float(variable.field, variable.low, variable.high, log=variable.logarithmic))
