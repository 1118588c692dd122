"""What a run with error bars leaves behind: a table on the screen, JSON, CSV and a picture."""

from __future__ import annotations

from dataclasses import asdict
from math import floor, log10
from pathlib import Path
from typing import TYPE_CHECKING, Any

from annelid.config import field_value
from annelid.draw.figures.experiments import Panel, uncertainty_figure
from annelid.experiment.uncertainty.parameters import UNMEASURED, scaled_fields
from annelid.experiment.uncertainty.quantities import Quantity
from annelid.experiment.uncertainty.study import Uncertainty, VariantRun
from annelid.output import write_csv, write_json

if TYPE_CHECKING:
    from rich.table import Table

UNKNOWN = "-"
DEFINITIONS = {
    "parameters": "sample standard deviation over the Monte Carlo samples",
    "time step": "largest difference between the run and one of finer physics steps",
    "elements": "largest difference between the run and one of more elements a side",
    "total": "root of the sum of the squares of those that are known",
    "order": "p of an error that goes as step**p, where two halvings of the step change the value the same way",
    "not converged": "the difference of time step or of elements exceeds half of the value",
}


def with_error(quantity: Quantity) -> str:
    """Writes a value with its total error, to two digits of the error: ``6.15 +- 0.21 cm``."""
    if quantity.value is None:
        return UNKNOWN
    digits, total = _digits(quantity), quantity.total
    error = "" if total is None else f" +- {quantity.factor * total:.{digits}f}"
    return f"{quantity.factor * quantity.value:z.{digits}f}{error} {quantity.shown_unit}"


def uncertainty_table(result: Uncertainty) -> Table:
    """Lays out values and errors as a table for the terminal; quantities that no run tells are left out."""
    from rich import box
    from rich.table import Table

    table = Table(
        title=f"{result.config.name}: error bars, {headline(result)}",
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        caption="\n".join(remarks(result)),
        caption_justify="left",
    )
    table.add_column("quantity", no_wrap=True)
    table.add_column("value", min_width=18, overflow="fold")
    for heading in ("parameters", "time step", "elements"):
        table.add_column(heading, justify="right", no_wrap=True, min_width=len(heading))
    for quantity in result.quantities:
        if quantity.value is not None or quantity.n_drawn:
            errors = (_error(quantity, error) for error in quantity.errors.values())
            table.add_row(quantity.label, "\n".join(filter(None, (with_error(quantity), quantity.note))), *errors)
    return table


def headline(result: Uncertainty) -> str:
    """Says how many worms were drawn, and how many of them kept an ordered rhythm."""
    drawn = result.of("drawn")
    untold = f" ({result.n_untold} too short to tell)" if result.n_untold else ""
    return f"{result.n_ordered} of {len(drawn)} Monte Carlo samples kept an ordered rhythm{untold}"


def remarks(result: Uncertainty) -> list[str]:
    """Says what was varied and what was not, which runs are finer, and which of them failed."""
    spread = result.spread
    varied = ", ".join(
        f"{name} +- {100 * error:.1f} %" for name, error in zip(spread.names, spread.relative_error, strict=True)
    )
    lines = [f"parameters: {varied or 'none'} ({spread.source})"]
    for reason in dict.fromkeys(result.left_out.values()):
        names = [name for name, of_it in result.left_out.items() if of_it == reason]
        remedy = f"; --vary {names[0]}=0.1 takes one of 10 %" if reason == UNMEASURED else ""
        lines.append(f"not varied: {', '.join(names)} ({reason}{remedy})")
    steps = [1e3 * run.changes["clock.physics_timestep_s"] for run in result.of("time step")]
    counts = [run.changes["body.mesh.elements_per_side"] for run in result.of("elements")]
    n_elements = field_value(result.config, "body.mesh.elements_per_side")
    lines.append(
        f"time step: {1e3 * result.config.clock.physics_timestep_s:g} ms against {_listed(steps)} ms; "
        f"elements a side: {n_elements} against {_listed(counts)}"
    )
    for run in result.runs:
        name = f"{run.kind} {_change(run)}".rstrip()
        if run.message:
            lines.append(f"stopped, no part in the errors: {name}: {run.message}")
        elif run.verdict in ("disordered", "silent"):
            lines.append(f"{run.verdict}: {name}: {run.reason}")
    return lines


def write_uncertainty(result: Uncertainty) -> tuple[Path, Path, Path]:
    """Writes ``uncertainty.json``, ``uncertainty.csv`` and ``uncertainty.png`` into the folder of the run.

    The JSON file holds all that the error bars come from, in SI units, the readings of every run among them; the CSV
    file has one line a quantity.

    Returns:
        The three paths.

    Raises:
        RunFileError: A file cannot be written.
    """
    stem = result.folder / "uncertainty"
    rows = {quantity.name: _row(quantity) for quantity in result.quantities}
    columns = ["quantity", *_row(result.quantities[0])]
    return (
        write_json(stem.with_suffix(".json"), as_json(result)),
        write_csv(stem.with_suffix(".csv"), columns, ([name, *row.values()] for name, row in rows.items())),
        uncertainty_figure(panels(result), stem.with_suffix(".png")),
    )


def as_json(result: Uncertainty) -> dict[str, Any]:
    """Returns all of a result as plain lists, numbers, strings and None."""
    spread = result.spread
    return {
        "name": result.config.name,
        "seed": result.config.seed,
        "definitions": DEFINITIONS,
        "drawn": len(result.of("drawn")),
        "ordered": result.n_ordered,
        "too_short_to_tell": result.n_untold,
        "varied": {
            name: {"relative_error": float(error), "fields": [path for path, _ in scaled_fields(result.config, name)]}
            for name, error in zip(spread.names, spread.relative_error, strict=True)
        },
        "correlation": spread.correlation.tolist(),
        "source": spread.source,
        "not_varied": dict(result.left_out),
        "quantities": {quantity.name: _row(quantity) for quantity in result.quantities},
        "runs": [asdict(run) | {"path": run.path.relative_to(result.folder).as_posix()} for run in result.runs],
    }


def panels(result: Uncertainty) -> list[Panel]:
    """Returns what the picture shows: elongation of each segment, and the period."""
    chosen = {
        "elongation of each segment, mean of its sensors (cm)": "elongation_mean_max_m.",
        "period (s)": "period_s",
    }
    found = []
    for title, start in chosen.items():
        of_it = [quantity for quantity in result.quantities if quantity.name.startswith(start)]
        ticks = [quantity.name.partition(".")[2] for quantity in of_it]
        values = [_shown(quantity, quantity.value) for quantity in of_it]
        errors = {kind: [_shown(quantity, quantity.errors[kind]) for quantity in of_it] for kind in of_it[0].errors}
        found.append(Panel(title, ticks, values, errors))
    return found


def _shown(quantity: Quantity, value: float | None) -> float | None:
    return None if value is None else quantity.factor * value


def _row(quantity: Quantity) -> dict[str, Any]:
    return {
        "unit": quantity.unit,
        "value": quantity.value,
        "parameters": quantity.parameters,
        "time_step": quantity.time_step,
        "elements": quantity.discretization,
        "total": quantity.total,
        "order": quantity.order,
        "n_drawn": quantity.n_drawn,
        "converged": quantity.converged,
        "note": quantity.note,
    }


def _error(quantity: Quantity, error: float | None) -> str:
    return UNKNOWN if error is None else f"{quantity.factor * error:.{_digits(quantity)}f}"


def _digits(quantity: Quantity) -> int:
    """Digits behind the point that show two of the total error."""
    total = quantity.total
    if not total:
        return quantity.digits
    return min(max(1 - floor(log10(quantity.factor * total)), 0), quantity.digits + 1)


def _listed(numbers: list[Any]) -> str:
    return " and ".join(f"{number:g}" for number in numbers) or "none"


def _change(run: VariantRun) -> str:
    return ", ".join(
        f"{path.rpartition('.')[2]} = {value:.4g}"
        for path, value in run.changes.items()
        if isinstance(value, int | float)
    )
