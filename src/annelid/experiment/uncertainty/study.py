"""A run with error bars: the run itself, Monte Carlo samples about it, finer steps and more elements.

What the error bars are:

* parameters: the sample standard deviation over n worms. The logarithms of their calibrated parameters are normal about
  the run's own values, with exactly the errors and the correlation of a fit to the load frame (`parameters.draw`);
* time step: the largest difference between the run and the same at half and, where that is a whole multiple of the
  control step, at a quarter of its physics step, its signals recorded as much more often, since onsets and maxima are
  read from the record;
* discretization: the largest difference between the run and the same with one and with two more elements a side.

The total is the root of the sum of their squares. All runs have the run's own seed and controller.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from annelid.body.worm import WormBody
from annelid.config import RunConfig
from annelid.errors import ConfigError, SimulationStopped
from annelid.experiment.case import Case
from annelid.experiment.outcome import Outcome
from annelid.experiment.store import Progress, Store, case_key
from annelid.experiment.uncertainty.parameters import Spread, applicable, changes, draw, read_spread
from annelid.experiment.uncertainty.quantities import (
    Quantity,
    Reading,
    largest_difference,
    order_of_convergence,
    readings,
    scatter,
)
from annelid.output import whole_file
from annelid.simulation.lock import locks
from annelid.simulation.runfile import FILE_NAME, read_config, refuse_used_folder

RUNS = "uncertainty"
"""Subfolder of the runs."""
FEWEST = 2
MOST_ELEMENTS = 32

Kind = Literal["nominal", "drawn", "time step", "elements"]


@dataclass(frozen=True)
class Variant(Case):
    """One run of the study: a configuration and what is changed in it.

    Attributes:
        kind: What the variant is for.
    """

    kind: Kind = "nominal"


@dataclass(frozen=True, slots=True)
class VariantRun:
    """One run of the study, done.

    Attributes:
        kind: What it is for.
        changes: Fields that differ from the run that gets the error bars, by dotted path.
        path: Folder of the run.
        verdict: Of its rhythm (`annelid.analysis.rhythm_score`); None where it is too short to tell.
        reason: Why.
        message: Why it ended before its time; empty if it did not.
        values: Its readings by name, in SI units.
    """

    kind: Kind
    changes: Mapping[str, Any]
    path: Path
    verdict: str | None
    reason: str
    message: str
    values: Mapping[str, float | None]


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """A run with error bars.

    Attributes:
        config: Its configuration.
        spread: What was varied, by how much, and where that is from.
        left_out: What was not varied: the reason by the parameter's name.
        quantities: Its numbers.
        runs: The run itself, first, and all others.
        folder: Folder of the run.
    """

    config: RunConfig
    spread: Spread
    left_out: Mapping[str, str]
    quantities: tuple[Quantity, ...]
    runs: tuple[VariantRun, ...]
    folder: Path

    def of(self, kind: Kind) -> tuple[VariantRun, ...]:
        """Returns the runs of one kind."""
        return tuple(run for run in self.runs if run.kind == kind)

    @property
    def n_ordered(self) -> int:
        """How many of the Monte Carlo samples kept an ordered rhythm to the end."""
        return sum(run.verdict == "ordered" and not run.message for run in self.of("drawn"))

    @property
    def n_untold(self) -> int:
        """How many of the Monte Carlo samples' rhythms are too short to tell."""
        return sum(run.verdict is None and not run.message for run in self.of("drawn"))


@locks("folder")
def uncertainty(
    config: RunConfig,
    n: int,
    folder: str | Path,
    *,
    spread: Spread | None = None,
    jobs: int | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Uncertainty:
    """Runs a worm and its variants, as far as the folder does not hold them, and gives its numbers error bars.

    Args:
        config: A 3D worm. Its seed is also that of the draw.
        n: How many worms are drawn, at least 2; others are drawn for another n.
        folder: Folder of the run, ``run.nc``; all runs are kept in ``uncertainty`` below it.
        spread: Errors of the parameters; by default those of annelid's own fit (`read_spread`).
        jobs: Processes, by default as many as there are cores.
        overwrite: Allow a folder that holds something else, and replace its ``run.nc``.
        progress: Called at the start and after every run.

    Returns:
        The run with its error bars. A variant that a guard stops has no part in them.

    Raises:
        ConfigError: The body is planar, n is below 2, or the folder is in use.
        RunFileError: A file cannot be written.
        SimulationStopped: A guard stopped the run itself; its file is kept.
        KeyboardInterrupt: Runs in progress are dropped, all others kept for a later call.
    """
    folder = Path(folder)
    if n < FEWEST:
        raise ConfigError(f"n = {n} worms have no standard deviation: draw at least {FEWEST}")
    chosen, left_out = applicable(config, read_spread() if spread is None else spread)
    variants = plan(config, n, chosen)
    _refuse_other_run(folder, config, overwrite)
    store = Store(folder / RUNS)
    outcomes = store.compute(variants, jobs=jobs, progress=progress)
    done = [_done(variant, outcomes[case_key(variant)]) for variant in variants]
    nominal = outcomes[case_key(variants[0])]
    with whole_file(folder / FILE_NAME) as draft:
        shutil.copyfile(nominal.path / FILE_NAME, draft)
    if nominal.message:
        raise SimulationStopped(nominal.message)
    return Uncertainty(config, chosen, left_out, combine(readings(nominal.summary), done), tuple(done), folder)


def plan(config: RunConfig, n: int, spread: Spread) -> list[Variant]:
    """Lists the runs of a study, the run itself first.

    Args:
        config: A 3D worm.
        n: How many worms are drawn.
        spread: Parameters that change it.
    """
    return [
        variant(config, "nominal", {}),
        *(variant(config, "drawn", changes(config, spread, row)) for row in draw(n, spread, config.seed)),
        *(variant(config, "time step", finer) for finer in finer_steps(config)),
        *(variant(config, "elements", {"body.mesh.elements_per_side": count}) for count in more_elements(config)),
    ]


def variant(config: RunConfig, kind: Kind, changed: Mapping[str, Any]) -> Variant:
    """Returns a variant of a run, with what is changed in it by dotted path."""
    return Variant(config.name, changed, config, kind)


def finer_steps(config: RunConfig) -> list[dict[str, float]]:
    """Returns the changes to about half of a physics step and, if that is a multiple of the control step, a quarter.

    What is longer than the control step stays a whole multiple of it, so that half of 5 ms is 2 ms where that is 1 ms.
    """
    control_s, step_s = config.clock.control_timestep_s, config.clock.physics_timestep_s
    ratio = round(step_s / control_s)

    def finer(divisor: int) -> dict[str, float]:
        step = step_s / divisor if ratio <= 1 else _multiple(step_s, divisor, control_s)
        interval = _multiple(config.record.signals_interval_s, divisor, control_s)
        return {"clock.physics_timestep_s": step, "record.signals_interval_s": interval}

    return [finer(2), *([finer(4)] if ratio > 1 and ratio % 4 == 0 else [])]


def more_elements(config: RunConfig) -> list[int]:
    """Returns one and two elements a side more than a worm has, as far as that is allowed."""
    assert isinstance(config.body, WormBody)
    count = config.body.mesh.elements_per_side
    return [finer for finer in (count + 1, count + 2) if finer <= MOST_ELEMENTS]


def combine(nominal: Sequence[Reading], runs: Sequence[VariantRun]) -> tuple[Quantity, ...]:
    """Joins the readings of a run and of its variants to error bars; runs that were stopped have no part in them."""

    def values(kind: Kind, name: str) -> list[float | None]:
        return [None if run.message else run.values[name] for run in runs if run.kind == kind]

    quantities = []
    for reading in nominal:
        drawn, steps = values("drawn", reading.name), values("time step", reading.name)
        quantities.append(
            Quantity(
                **asdict(reading),
                parameters=scatter(drawn),
                time_step=largest_difference(reading.value, steps),
                discretization=largest_difference(reading.value, values("elements", reading.name)),
                order=order_of_convergence(reading.value, *steps) if len(steps) > 1 else None,
                n_drawn=sum(value is not None for value in drawn),
            )
        )
    return tuple(quantities)


def _multiple(duration_s: float, divisor: int, unit_s: float) -> float:
    """The greatest multiple of a unit that is no longer than a part of a duration, at least the unit itself, s."""
    return round(max(round(duration_s / unit_s) // divisor, 1) * unit_s, 12)


def _done(variant: Variant, outcome: Outcome) -> VariantRun:
    return VariantRun(
        kind=variant.kind,
        changes=variant.changes,
        path=outcome.path,
        verdict=outcome.rhythm.verdict,
        reason=outcome.rhythm.reason,
        message=outcome.message,
        values={reading.name: reading.value for reading in readings(outcome.summary)},
    )


def _refuse_other_run(folder: Path, config: RunConfig, overwrite: bool) -> None:
    """Lets a study go on in its own folder, and into an empty one."""
    if overwrite or not (folder / RUNS).is_dir():
        refuse_used_folder(folder, overwrite)
    elif (folder / FILE_NAME).exists() and read_config(folder) != config:
        raise ConfigError(f"the output folder {folder} holds another run: name another, or allow overwriting")
