"""A run with error bars, as `DEFINITIONS` says: the run itself, samples about it, finer steps and more elements.

The logarithms of the samples' calibrated parameters are normal about the run's own values, with exactly the errors and
the correlation of a fit to the load frame (`spread.draw`). Finer steps have signals recorded as much more often, since
onsets and maxima are read from the record. All runs have the run's own seed and controller.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from math import floor, log10, sqrt
from pathlib import Path
from statistics import stdev
from typing import Any, Literal

from rich.table import Table

from annelid.analysis import Summary
from annelid.config import RunConfig, unit_of
from annelid.draw.figures.experiments import Panel, uncertainty_figure
from annelid.draw.table import framed_table
from annelid.errors import ConfigError, SimulationStopped
from annelid.experiment.case import Case
from annelid.experiment.check import STEP, finer_steps, go_on_in, more_elements
from annelid.experiment.executors import workers
from annelid.experiment.progress import StudyProgress
from annelid.experiment.spread import UNMEASURED, Spread, applicable, changes, draw, read_spread, scaled_fields
from annelid.experiment.store import Store, case_key
from annelid.output import whole_file, write_csv, write_json
from annelid.simulation.lock import locks
from annelid.simulation.runfile import FILE_NAME

__all__ = [
    "Quantity",
    "Spread",
    "Uncertainty",
    "VariantRun",
    "read_spread",
    "uncertainty",
    "uncertainty_table",
    "write_uncertainty",
]

RUNS = "uncertainty"
"""Subfolder of the runs."""
FEWEST = 2
DEFINITIONS = {
    "parameters": "sample standard deviation over the Monte Carlo samples",
    "time step": "largest difference between the run and one of finer physics steps",
    "elements": "largest difference between the run and one of more elements a side",
    "total": "root of the sum of the squares of those that are known",
    "not converged": "the difference of time step or of elements exceeds half of the value",
}
NOT_CONVERGED = 0.5
"""Numerical error, of the value, above which a quantity does not count as converged."""
UNKNOWN = "-"
SHOWN: Mapping[str, tuple[str, str, float, int]] = {
    "period_s": ("period", "s", 1.0, 3),
    "elongation_mean_max_m": ("elongation {}, mean", "cm", 100.0, 2),
    "elongation_first_helix_pp_m": ("first helix {}, pp", "cm", 100.0, 2),
    "middle_deficit_mean": ("middle deficit, mean", "%", 100.0, 1),
    "middle_deficit": ("middle deficit, pp", "%", 100.0, 1),
    "contraction_force_median_N": ("force, median", "N", 1.0, 2),
    "travel_m": ("travel forwards", "mm", 1000.0, 1),
    "speed_m_per_s": ("speed", "mm/s", 1000.0, 2),
}
"""What gets error bars: its label, with the segment where it is one per segment, the unit in which it is shown, what
the value is multiplied by for that, and digits behind the point where no error says how many."""

Kind = Literal["nominal", "drawn", "time step", "elements"]


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number of a run with its error bars, all in its ``unit``; None for what is not known.

    Attributes:
        name: Field of the summary, with the segment behind a point where it is one per segment.
        value: The number.
        parameters: Sample standard deviation over the Monte Carlo samples.
        time_step: Largest difference between the run and one of finer steps.
        discretization: Largest difference between the run and one of more elements.
        n_drawn: Number of Monte Carlo samples that it was read in.
    """

    name: str
    value: float | None
    parameters: float | None
    time_step: float | None
    discretization: float | None
    n_drawn: int

    @property
    def unit(self) -> str:
        """Unit of the value and its errors; "1" for a share."""
        return unit_of(self.name.partition(".")[0]) or "1"

    @property
    def label(self) -> str:
        """What it is called."""
        field, _, segment = self.name.partition(".")
        return SHOWN[field][0].format(segment)

    @property
    def errors(self) -> dict[str, float | None]:
        """The three errors by their kinds."""
        return {"parameters": self.parameters, "time step": self.time_step, "elements": self.discretization}

    @property
    def total(self) -> float | None:
        """Root of the sum of the squares of those errors that are known; None if none is."""
        known = [error for error in self.errors.values() if error is not None]
        return sqrt(sum(error**2 for error in known)) if known else None

    @property
    def converged(self) -> bool | None:
        """Whether neither numerical error exceeds half of the value; None as long as one of them is not known."""
        if self._faults:
            return False
        return None if None in (self.value, self.time_step, self.discretization) else True

    @property
    def note(self) -> str:
        """What is wrong with it, in words; empty where nothing is."""
        if self.value is None:
            return "not known from this run"
        unknown = [kind for kind, error in self.errors.items() if error is None]
        words = [f"not converged: {' and '.join(self._faults)}"] if self._faults else []
        words += [f"without {' and '.join(unknown)}"] if unknown else []
        return "; ".join(words)

    @property
    def _faults(self) -> list[str]:
        limit = None if self.value is None else NOT_CONVERGED * abs(self.value)
        numerical = {"time step": self.time_step, "elements": self.discretization}
        return [kind for kind, error in numerical.items() if limit is not None and error is not None and error > limit]

    def shown(self, value: float | None) -> float | None:
        """Returns a value of it in the unit in which it is shown."""
        return None if value is None else self._format[1] * value

    def error_text(self, error: float | None) -> str:
        """Writes one of its errors with the digits that show two of the total."""
        return UNKNOWN if error is None else f"{self.shown(error):.{self._digits}f}"

    def __str__(self) -> str:
        """Its value with its total error, to two digits of the error: ``6.15 +- 0.21 cm``."""
        if self.value is None:
            return UNKNOWN
        error = "" if self.total is None else f" +- {self.error_text(self.total)}"
        return f"{self.shown(self.value):z.{self._digits}f}{error} {self._format[0]}"

    @property
    def _format(self) -> tuple[str, float, int]:
        return SHOWN[self.name.partition(".")[0]][1:]

    @property
    def _digits(self) -> int:
        _, factor, digits = self._format
        return min(max(1 - floor(log10(factor * self.total)), 0), digits + 1) if self.total else digits


@dataclass(frozen=True, slots=True)
class VariantRun:
    """One run of the study, done.

    Attributes:
        kind: What it is for.
        changes: Fields that differ from the run that gets the error bars, by dotted path.
        path: Folder of the run.
        verdict: Of its rhythm (`annelid.analysis.rhythm_score`); None where it is too short for one.
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
        """How many of the Monte Carlo samples ran too short for a verdict on their rhythm."""
        return sum(run.verdict is None and not run.message for run in self.of("drawn"))


@locks("folder")
def uncertainty(
    config: RunConfig,
    n: int,
    folder: str | Path,
    *,
    spread: Spread | None = None,
    executor: Executor | None = None,
    jobs: int | None = None,
    overwrite: bool = False,
    progress: StudyProgress | None = None,
) -> Uncertainty:
    """Runs a worm and its variants, as far as the folder does not have them, and gives its numbers error bars.

    Args:
        config: A 3D worm. Its seed is also that of the samples.
        n: How many Monte Carlo samples are drawn, at least 2; others are drawn for another n.
        folder: Folder of the run, ``run.nc``; all runs are kept in ``uncertainty`` below it.
        spread: Errors of the parameters; by default those of annelid's own fit (`read_spread`).
        executor: Who computes the runs; None for processes of this machine.
        jobs: How many processes, by default one a core.
        overwrite: Allow a folder that has something else in it, and replace its ``run.nc``.
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
    variants: list[tuple[Kind, Case]] = [
        (kind, Case(config.name, changed, config)) for kind, changed in plan(config, n, chosen)
    ]
    go_on_in(folder, RUNS, config, overwrite=overwrite)
    with workers(executor, jobs) as given:
        outcomes = Store(folder / RUNS, given, progress=progress).compute([case for _, case in variants], "error bars")
    found = [outcomes[case_key(case)] for _, case in variants]
    done = tuple(
        VariantRun(kind, case.changes, of.path, of.rhythm.verdict, of.rhythm.reason, of.message, readings(of.summary))
        for (kind, case), of in zip(variants, found, strict=True)
    )
    nominal = found[0]
    with whole_file(folder / FILE_NAME) as draft:
        shutil.copyfile(nominal.path / FILE_NAME, draft)
    if nominal.message:
        raise SimulationStopped(nominal.message)
    return Uncertainty(config, chosen, left_out, combine(readings(nominal.summary), done), done, folder)


def plan(config: RunConfig, n: int, spread: Spread) -> list[tuple[Kind, dict[str, Any]]]:
    """Lists what is changed in each run of a study, the run itself first, with n samples of a spread."""
    return [
        ("nominal", {}),
        *(("drawn", changes(config, spread, row)) for row in draw(n, spread, config.seed)),
        *(("time step", finer) for finer in finer_steps(config)),
        *(("elements", finer) for finer in more_elements(config)),
    ]


def readings(numbers: Summary) -> dict[str, float | None]:
    """Returns what gets error bars in SI units by field, with the segment behind a point; speed is travel over time."""
    travel, duration = numbers.travel_m, numbers.duration_s
    found: dict[str, float | None] = {}
    for field, (label, *_) in SHOWN.items():
        if field == "speed_m_per_s":
            found[field] = travel / duration if travel is not None and duration else None
        elif "{}" in label:
            lengths = getattr(numbers, field) or [None] * numbers.n_segments
            found |= {f"{field}.{segment}": value for segment, value in enumerate(lengths, start=1)}
        else:
            found[field] = getattr(numbers, field)
    return found


def combine(nominal: Mapping[str, float | None], runs: Sequence[VariantRun]) -> tuple[Quantity, ...]:
    """Joins the readings of a run and of its variants to error bars; runs that were stopped have no part in them."""

    def values(kind: Kind, name: str) -> list[float | None]:
        return [None if run.message else run.values[name] for run in runs if run.kind == kind]

    quantities = []
    for name, value in nominal.items():
        drawn, steps = values("drawn", name), values("time step", name)
        quantities.append(
            Quantity(
                name,
                value,
                parameters=scatter(drawn),
                time_step=largest_difference(value, steps),
                discretization=largest_difference(value, values("elements", name)),
                n_drawn=sum(one is not None for one in drawn),
            )
        )
    return tuple(quantities)


def scatter(values: Sequence[float | None]) -> float | None:
    """Sample standard deviation of the values that are known; None for fewer than two."""
    known = [value for value in values if value is not None]
    return stdev(known) if len(known) > 1 else None


def largest_difference(value: float | None, finer: Sequence[float | None]) -> float | None:
    """Largest distance of a value from those of finer runs; None if it or all of them are unknown."""
    differences = [abs(value - other) for other in finer if value is not None and other is not None]
    return max(differences, default=None)


def uncertainty_table(result: Uncertainty) -> Table:
    """Lays out values and errors as a table for the terminal; quantities that no run has are left out."""
    untold = f" ({result.n_untold} too short to tell)" if result.n_untold else ""
    samples = f"{result.n_ordered} of {len(result.of('drawn'))} Monte Carlo samples kept an ordered rhythm{untold}"
    table = framed_table(title=f"{result.config.name}: error bars, {samples}", caption="\n".join(_remarks(result)))
    table.add_column("quantity", no_wrap=True)
    table.add_column("value", min_width=18, overflow="fold")
    for heading in ("parameters", "time step", "elements"):
        table.add_column(heading, justify="right", no_wrap=True, min_width=len(heading))
    for quantity in result.quantities:
        if quantity.value is not None or quantity.n_drawn:
            errors = map(quantity.error_text, quantity.errors.values())
            table.add_row(quantity.label, "\n".join(filter(None, (str(quantity), quantity.note))), *errors)
    return table


def _remarks(result: Uncertainty) -> list[str]:
    """Says what was varied and what was not, which runs are finer, and which of them failed."""
    spread, config = result.spread, result.config
    errors = zip(spread.names, spread.relative_error, strict=True)
    varied = ", ".join(f"{name} +- {100 * error:.1f} %" for name, error in errors)
    lines = [f"parameters: {varied or 'none'} ({spread.source})"]
    for reason in dict.fromkeys(result.left_out.values()):
        names = [name for name, of_it in result.left_out.items() if of_it == reason]
        remedy = f"; --vary {names[0]}=0.1 takes one of 10 %" if reason == UNMEASURED else ""
        lines.append(f"not varied: {', '.join(names)} ({reason}{remedy})")
    steps = _listed([1e3 * run.changes[STEP] for run in result.of("time step")])
    elements = config.body.elements
    assert elements is not None
    counts = _listed([run.changes[elements.field] for run in result.of("elements")])
    lines.append(
        f"time step: {1e3 * config.clock.physics_timestep_s:g} ms against {steps} ms; "
        f"elements a side: {elements.number} against {counts}"
    )
    for run in result.runs:
        changed = {path.rpartition(".")[2]: value for path, value in run.changes.items()}
        words = ", ".join(f"{name} = {value:.4g}" for name, value in changed.items() if isinstance(value, int | float))
        name = f"{run.kind} {words}".rstrip()
        if run.message:
            lines.append(f"stopped, no part in the errors: {name}: {run.message}")
        elif run.verdict in ("disordered", "silent"):
            lines.append(f"{run.verdict}: {name}: {run.reason}")
    return lines


def _listed(numbers: list[Any]) -> str:
    return " and ".join(f"{number:g}" for number in numbers) or "none"


def write_uncertainty(result: Uncertainty) -> tuple[Path, Path, Path]:
    """Writes ``uncertainty.json``, ``uncertainty.csv`` and ``uncertainty.png`` into the folder of the run.

    The JSON file has all that the error bars come from, in SI units, the readings of every run among them; the CSV
    file has one line a quantity.

    Args:
        result: The run with its error bars.

    Returns:
        The three paths.

    Raises:
        RunFileError: A file cannot be written.
    """
    stem, spread = result.folder / "uncertainty", result.spread
    rows = {quantity.name: _row(quantity) for quantity in result.quantities}
    content = {
        "name": result.config.name,
        "seed": result.config.seed,
        "definitions": DEFINITIONS,
        "drawn": len(result.of("drawn")),
        "ordered": result.n_ordered,
        "too_short_to_tell": result.n_untold,
        "varied": {
            name: {"relative_error": float(error), "fields": list(scaled_fields(result.config, name))}
            for name, error in zip(spread.names, spread.relative_error, strict=True)
        },
        "correlation": spread.correlation.tolist(),
        "source": spread.source,
        "not_varied": dict(result.left_out),
        "quantities": rows,
        "runs": [asdict(run) | {"path": run.path.relative_to(result.folder).as_posix()} for run in result.runs],
    }
    columns = ["quantity", *next(iter(rows.values()))]
    return (
        write_json(stem.with_suffix(".json"), content),
        write_csv(stem.with_suffix(".csv"), columns, ([name, *row.values()] for name, row in rows.items())),
        uncertainty_figure(
            [
                _panel(result, "elongation of each segment, mean of its sensors (cm)", "elongation_mean_max_m."),
                _panel(result, "period (s)", "period_s"),
            ],
            stem.with_suffix(".png"),
        ),
    )


def _row(quantity: Quantity) -> dict[str, Any]:
    return {
        "unit": quantity.unit,
        "value": quantity.value,
        "parameters": quantity.parameters,
        "time_step": quantity.time_step,
        "elements": quantity.discretization,
        "total": quantity.total,
        "n_drawn": quantity.n_drawn,
        "converged": quantity.converged,
        "note": quantity.note,
    }


def _panel(result: Uncertainty, title: str, start: str) -> Panel:
    """What the picture shows of the quantities whose names start alike."""
    of_it = [quantity for quantity in result.quantities if quantity.name.startswith(start)]
    return Panel(
        title,
        ticks=[quantity.name.partition(".")[2] for quantity in of_it],
        values=[quantity.shown(quantity.value) for quantity in of_it],
        errors={kind: [one.shown(one.errors[kind]) for one in of_it] for kind in of_it[0].errors},
    )
