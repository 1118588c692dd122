"""What a sweep leaves behind: netCDF, CSV, a figure, a table of the highest, lowest and failed runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from annelid.draw.figures.sweep import sweep_figure, worded
from annelid.experiment.sweep.dataset import SEGMENT, Sweep
from annelid.experiment.sweep.design import REPEAT, label
from annelid.experiment.sweep.numbers import PREFERRED
from annelid.output import whole_file, write_csv

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table

DATASET, ROWS, FIGURE = "sweep.nc", "sweep.csv", "sweep"
N_TOLD = 4
"""Numbers in the table and panels in the figure."""
N_ENDS, N_FAILED = 3, 8
"""Rows of the table: from either end, and of reasons."""


def write_results(sweep: Sweep, data: xr.Dataset) -> list[Path]:
    """Writes a sweep's dataset, its rows and its figure.

    Returns:
        The paths; without a figure where there is no number to draw.

    Raises:
        RunFileError: A file cannot be written.
    """
    sweep.folder.mkdir(parents=True, exist_ok=True)
    path = sweep.folder / DATASET
    with whole_file(path) as draft:
        data.to_netcdf(draft, engine="h5netcdf")
    written = [path, write_rows(sweep, data, sweep.folder / ROWS)]
    told = told_numbers(sweep, data)
    if told:
        written.append(sweep_figure(drawn(data, told), sweep.plan.fields, told, sweep.folder / FIGURE))
    return written


def write_rows(sweep: Sweep, data: xr.Dataset, path: Path) -> Path:
    """Writes one row a run as CSV with a header; what is told of every segment has a column for each.

    Raises:
        RunFileError: The file cannot be written.
    """
    columns: dict[str, np.ndarray] = {}
    for number in sweep.numbers:
        values = data[number.name].values.reshape(len(sweep.runs), -1)
        names = [f"{number.name}_{i}" for i in data[SEGMENT].values] if number.per_segment else [number.name]
        columns |= dict(zip(names, values.T, strict=True))
    rows = (
        [
            i,
            *_place(sweep, data, i),
            run.status,
            run.reason,
            " | ".join(run.warnings),
            "" if run.outcome is None else run.outcome.path.name,
            *("" if np.isnan(values[i]) else f"{values[i]:.10g}" for values in columns.values()),
        ]
        for i, run in enumerate(sweep.runs)
    )
    repeat = ["seed"] if REPEAT in data.dims else []
    heads = ["number", *sweep.plan.fields, *repeat, "status", "reason", "warnings", "run", *columns]
    return write_csv(path, heads, rows)


def told_numbers(sweep: Sweep, data: xr.Dataset) -> list[str]:
    """Returns which numbers the table and the figure tell: the one to rank by first, and only such as there are."""
    kept = {number.name for number in sweep.numbers}
    first = [] if sweep.plan.study.rank is None else [sweep.plan.study.rank]
    wanted = dict.fromkeys([*first, *(sweep.plan.study.outputs or PREFERRED)])
    return [name for name in wanted if name in kept and bool(np.isfinite(data[name]).any())][:N_TOLD]


def drawn(data: xr.Dataset, names: Sequence[str]) -> xr.Dataset:
    """Returns numbers to draw, what is one a segment as its mean over the segments."""
    chosen = data[[*names, "status"]]
    for name in names:
        if SEGMENT in chosen[name].dims:
            text = f"{chosen[name].attrs['long_name']}, mean of segments"
            chosen[name] = chosen[name].mean(SEGMENT).assign_attrs(chosen[name].attrs | {"long_name": text})
    return chosen


def results_table(sweep: Sweep, data: xr.Dataset) -> Table:
    """Returns the runs with the highest and the lowest values of the first number, and those that failed and why."""
    from rich.table import Table

    told = told_numbers(sweep, data)
    chosen = drawn(data, told)
    columns = {name: chosen[name].values.reshape(-1) for name in told}
    table = Table(title=_title(sweep, told))
    heads = [worded(name.rsplit(".", 1)[-1], data[name].attrs["units"]) for name in (*sweep.plan.fields, *told)]
    n = len(sweep.plan.fields)
    for head in ("run", *heads[:n], *([REPEAT] if REPEAT in data.dims else []), *heads[n:]):
        table.add_column(head, justify="right")
    for rows in _ends(columns[told[0]]) if told else []:
        for i in rows:
            values = (_short(column[i]) for column in columns.values())
            table.add_row(str(i), *_place(sweep, data, i), *values)
        table.add_section()
    table.caption = _caption(sweep)
    return table


def failures(sweep: Sweep) -> list[tuple[str, list[int]]]:
    """Returns why runs failed or were stopped, and the numbers of those runs, the most frequent reason first."""
    by_reason: dict[str, list[int]] = {}
    for i, run in enumerate(sweep.runs):
        if run.status != "complete":
            by_reason.setdefault(f"{run.status}: {run.reason}", []).append(i)
    return sorted(by_reason.items(), key=lambda item: -len(item[1]))


def _title(sweep: Sweep, told: Sequence[str]) -> str:
    return f"{sweep.plan.study.name}: {f'highest and lowest {told[0]}' if told else 'no number can be told'}"


def _caption(sweep: Sweep) -> str:
    n, reasons = len(sweep.runs), failures(sweep)
    lines = [f"{n} runs, of which {sum(run.status == 'complete' for run in sweep.runs)} are complete"]
    doubtful = [i for i, run in enumerate(sweep.runs) if run.warnings]
    if doubtful:
        lines[0] += f", and {len(doubtful)} have warnings (run {_listed(doubtful)}), which {ROWS} has"
    for reason, numbers in reasons[:N_FAILED]:
        lines.append(f"{len(numbers)} {reason} (run {_listed(numbers)})")
    if len(reasons) > N_FAILED:
        lines.append(f"{len(reasons) - N_FAILED} more reasons in {ROWS}")
    return "\n".join(lines)


def _listed(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers[:5])) + (", .." if len(numbers) > 5 else "")


def _place(sweep: Sweep, data: xr.Dataset, i: int) -> list[str]:
    """Values of the varied fields of a run, and its seed where there are repeats."""
    point = sweep.plan.points[i]
    seed = [str(data[REPEAT].values[point.place[-1]])] if REPEAT in data.dims else []
    return [*(label(value) for value in point.values.values()), *seed]


def _ends(values: np.ndarray) -> list[list[int]]:
    """Returns the places of the highest and of the lowest values, without telling one twice."""
    order = [int(i) for i in np.argsort(-values, kind="stable") if np.isfinite(values[i])]
    if len(order) <= 2 * N_ENDS:
        return [order]
    return [order[:N_ENDS], order[-N_ENDS:]]


def _short(number: float) -> str:
    return "" if np.isnan(number) else f"{number:.4g}"
