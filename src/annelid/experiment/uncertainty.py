"""A run with error bars, as `DEFINITIONS` says: the run itself, samples about it, finer steps and more elements.

The logarithms of the samples' calibrated parameters are normal about the run's own values, with exactly the errors and
the correlation of a fit to the load frame (`spread.draw`). All runs have the run's own seed and controller.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from math import floor, log10, sqrt
from pathlib import Path
from statistics import stdev
from typing import Any

from rich.table import Table

from annelid.analysis import NUMBERS
from annelid.analysis.numbers import UNKNOWN, Number
from annelid.config import RunConfig
from annelid.draw.figures.experiments import uncertainty_figure
from annelid.errors import ConfigError
from annelid.experiment.finer_runs import STEP, finer_steps, more_elements, run_with_variants
from annelid.experiment.outcome import Outcome
from annelid.experiment.parameter_errors import (
    UNMEASURED,
    Spread,
    applicable,
    changes,
    draw,
    read_spread,
    scaled_fields,
)
from annelid.experiment.progress import StudyProgress
from annelid.experiment.store import Done
from annelid.output import write_csv, write_json
from annelid.simulation.lock import locks

__all__ = ["Quantity", "Spread", "Uncertainty", "read_spread", "uncertainty", "uncertainty_table", "write_uncertainty"]

RUNS = "uncertainty"
"""Subfolder of the runs, and the name of the files of results."""
FEWEST = 2
DEFINITIONS = {
    "parameters": "sample standard deviation over the Monte Carlo samples",
    "time step": "largest difference between the run and one of finer physics steps",
    "elements": "largest difference between the run and one of more elements a side",
    "total": "root of the sum of the squares of those that are known",
}
SHOWN = (
    "period_s",
    "elongation_mean_max_m",
    "elongation_first_helix_pp_m",
    "middle_deficit_mean",
    "middle_deficit",
    "contraction_force_median_N",
    "travel_m",
    "speed_m_per_s",
)
"""The numbers that get error bars."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number of a run with its error bars, all in its ``unit``; None for what is not known.

    Attributes:
        name: Of the number, with the segment behind a point where it is one per segment.
        value: The number.
        parameters: Sample standard deviation over the Monte Carlo samples.
        time_step: Largest difference between the run and one of finer steps.
        elements: Largest difference between the run and one of more elements.
        n_samples: Number of Monte Carlo samples that it was read in.
    """

    name: str
    value: float | None
    parameters: float | None
    time_step: float | None
    elements: float | None
    n_samples: int

    @property
    def number(self) -> Number:
        """What the number is, and how a table shows it."""
        return NUMBERS[self.name.partition(".")[0]]

    @property
    def label(self) -> str:
        """What it is called."""
        return f"{self.number.label} {self.name.partition('.')[2]}".rstrip()

    @property
    def errors(self) -> dict[str, float | None]:
        """The three errors by their kinds."""
        return {"parameters": self.parameters, "time step": self.time_step, "elements": self.elements}

    @property
    def total(self) -> float | None:
        """Root of the sum of the squares of those errors that are known; None if none is."""
        known = [error for error in self.errors.values() if error is not None]
        return sqrt(sum(error**2 for error in known)) if known else None

    @property
    def row(self) -> dict[str, Any]:
        """What the files of results say of it."""
        return {
            "unit": self.number.unit,
            "value": self.value,
            "parameters": self.parameters,
            "time_step": self.time_step,
            "elements": self.elements,
            "total": self.total,
            "n_samples": self.n_samples,
        }

    def error_text(self, error: float | None) -> str:
        """Writes one of its errors with the digits that show two of the total."""
        return UNKNOWN if error is None else f"{self.number.factor * error:.{self._digits}f}"

    def __str__(self) -> str:
        """Its value with its total error, to two digits of the error: ``6.15 +- 0.21 cm``."""
        if self.value is None:
            return UNKNOWN
        error = "" if self.total is None else f" +- {self.error_text(self.total)}"
        shown = f"{self.number.factor * self.value:z.{self._digits}f}" if self.total else self.number.text(self.value)
        return f"{shown}{error} {self.number.shown_unit}".rstrip()

    @property
    def _digits(self) -> int:
        """Digits behind the point that show two digits of the total error, or four of a value that is far larger."""
        sizes = ((1, self.total), (3, self.value))
        points = (digits - floor(log10(self.number.factor * abs(size))) for digits, size in sizes if size)
        return max(0, min(points, default=0))


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """A run with error bars.

    Attributes:
        config: Its configuration.
        spread: What was varied, by how much, and where that is from.
        left_out: What was not varied: the reason by the parameter's name.
        itself: The run.
        variants: All others by what they are for ("parameters", "time step", "elements"): the fields that differ, by
            dotted path, and what became of each.
        folder: Folder of the run.
    """

    config: RunConfig
    spread: Spread
    left_out: Mapping[str, str]
    itself: Outcome
    variants: Mapping[str, Sequence[tuple[Mapping[str, Any], Done]]]
    folder: Path

    @property
    def runs(self) -> list[tuple[str, Mapping[str, Any], Done]]:
        """The run itself, first, and all others: what each is for, what differs, and what became of it."""
        others = [(kind, *one) for kind, of_kind in self.variants.items() for one in of_kind]
        return [("itself", {}, Done(self.itself)), *others]

    @property
    def quantities(self) -> list[Quantity]:
        """Its numbers with their error bars; runs that failed or were stopped have no part in them."""
        found = {
            kind: [readings(done.outcome) for _, done in of_kind if done.outcome is not None and not done.reason]
            for kind, of_kind in self.variants.items()
        }
        return [
            quantity_of(name, value, {kind: [one[name] for one in runs] for kind, runs in found.items()})
            for name, value in readings(self.itself).items()
        ]

    @property
    def samples(self) -> str:
        """How many of the Monte Carlo samples kept an ordered rhythm to the end, in words."""
        whole = [done.outcome for _, done in self.variants["parameters"] if done.outcome and not done.reason]
        verdicts = [one.rhythm.verdict for one in whole]
        too_short = f" ({n} too short to tell)" if (n := verdicts.count(None)) else ""
        of = len(self.variants["parameters"])
        return f"{verdicts.count('ordered')} of {of} Monte Carlo samples kept an ordered rhythm{too_short}"


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
        The run with its error bars. A variant that fails or that a guard stops has no part in them.

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
    planned = plan(config, n, chosen)
    how: dict[str, Any] = {"executor": executor, "jobs": jobs, "overwrite": overwrite, "progress": progress}
    changed = [one for of_kind in planned.values() for one in of_kind]
    itself, *done = run_with_variants(config, folder, RUNS, changed, **how)
    assert itself.outcome is not None
    came = iter(done)
    variants = {kind: [(changed, next(came)) for changed in of_kind] for kind, of_kind in planned.items()}
    return Uncertainty(config, chosen, left_out, itself.outcome, variants, folder)


def plan(config: RunConfig, n: int, spread: Spread) -> dict[str, list[dict[str, Any]]]:
    """Lists what is changed in each variant by what it is for, with n samples of a spread."""
    return {
        "parameters": [changes(config, spread, row) for row in draw(n, spread, config.seed)],
        "time step": [*finer_steps(config)],
        "elements": [*more_elements(config)],
    }


def readings(outcome: Outcome) -> dict[str, float | None]:
    """Returns what gets error bars in SI units by name, with the segment behind a point."""
    found: dict[str, float | None] = {}
    for name in SHOWN:
        value = getattr(outcome.summary, name)
        if NUMBERS[name].per_segment:
            values = [None] * outcome.summary.n_segments if value is None else value
            found |= {f"{name}.{segment}": one for segment, one in enumerate(values, start=1)}
        else:
            found[name] = value
    return found


def quantity_of(name: str, value: float | None, others: Mapping[str, Sequence[float | None]]) -> Quantity:
    """Joins a number of a run and the same of its variants by what they are for; None where a run does not have it."""
    known = {kind: [one for one in values if one is not None] for kind, values in others.items()}
    samples = known["parameters"]

    def largest(kind: str) -> float | None:
        return None if value is None else max((abs(value - one) for one in known[kind]), default=None)

    scatter = stdev(samples) if len(samples) > 1 else None
    return Quantity(name, value, scatter, largest("time step"), largest("elements"), len(samples))


def uncertainty_table(result: Uncertainty) -> Table:
    """Lays out values and errors as a table for the terminal; quantities that no run has are left out."""
    title = f"{result.config.name}: error bars, {result.samples}"
    table = Table(title=title, caption="\n".join(_remarks(result)), box=None, pad_edge=False)
    table.add_column("quantity", no_wrap=True)
    table.add_column("value")
    for heading in ("parameters", "time step", "elements"):
        table.add_column(heading, justify="right", no_wrap=True)
    for quantity in result.quantities:
        if quantity.value is not None or quantity.n_samples:
            errors = map(quantity.error_text, quantity.errors.values())
            table.add_row(quantity.label, str(quantity), *errors)
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
    steps = " and ".join(f"{1e3 * changed[STEP]:g}" for changed, _ in result.variants["time step"])
    counts = " and ".join(f"{count}" for changed, _ in result.variants["elements"] for count in changed.values())
    elements = config.body.elements
    assert elements is not None
    lines.append(
        f"time step: {1e3 * config.clock.physics_timestep_s:g} ms against {steps} ms; "
        f"elements a side: {elements.number} against {counts or 'none'}"
    )
    for kind, changed, done in result.runs:
        numbers = {path.rpartition(".")[2]: one for path, one in changed.items() if isinstance(one, int | float)}
        name = " ".join([kind, ", ".join(f"{field} = {value:.4g}" for field, value in numbers.items())]).rstrip()
        if done.outcome is None or done.reason:
            lines.append(f"{done.status}, no part in the errors: {name}: {done.reason}")
        elif done.outcome.rhythm.verdict in ("disordered", "silent"):
            lines.append(f"{done.outcome.rhythm.verdict}: {name}: {done.outcome.rhythm.reason}")
    return lines


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
    stem, spread = result.folder / RUNS, result.spread
    rows = {quantity.name: quantity.row for quantity in result.quantities}
    content = {
        "name": result.config.name,
        "seed": result.config.seed,
        "definitions": DEFINITIONS,
        "samples": result.samples,
        "varied": {
            name: {"relative_error": float(error), "fields": list(scaled_fields(result.config, name))}
            for name, error in zip(spread.names, spread.relative_error, strict=True)
        },
        "correlation": spread.correlation.tolist(),
        "source": spread.source,
        "not_varied": dict(result.left_out),
        "quantities": rows,
        "runs": [
            {"kind": kind, "changes": changed, "status": done.status, "reason": done.reason}
            | ({} if done.outcome is None else _reading(result, done.outcome))
            for kind, changed, done in result.runs
        ],
    }
    columns = ["quantity", *next(iter(rows.values()))]
    return (
        write_json(stem.with_suffix(".json"), content),
        write_csv(stem.with_suffix(".csv"), columns, ([name, *row.values()] for name, row in rows.items())),
        uncertainty_figure(rows, stem.with_suffix(".png")),
    )


def _reading(result: Uncertainty, outcome: Outcome) -> dict[str, Any]:
    return {
        "path": outcome.path.relative_to(result.folder).as_posix(),
        "rhythm": outcome.rhythm.verdict,
        "values": readings(outcome),
    }
