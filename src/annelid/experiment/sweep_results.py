"""What a sweep leaves behind: netCDF, CSV, a figure, a table of the highest, lowest and failed runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from rich.table import Table

from annelid.draw.figures.sweep import sweep_figure, worded
from annelid.experiment.numbers import PREFERRED
from annelid.experiment.sweep import REPEAT, SEGMENT, Sweep, label
from annelid.output import whole_file, write_csv

DATASET, ROWS, FIGURE = "sweep.nc", "sweep.csv", "sweep"
N_SHOWN = 4
"""Numbers in the table and panels in the figure."""
N_ENDS, N_FAILED = 3, 8
"""Rows of the table: from either end, and of reasons."""


def write_results(sweep: Sweep) -> list[Path]:
    """Writes a sweep's dataset, its rows and its figure; without the figure where there is no number to draw."""
    sweep.folder.mkdir(parents=True, exist_ok=True)
    path = sweep.folder / DATASET
    with whole_file(path) as draft:
        sweep.data.to_netcdf(draft, engine="h5netcdf")
    written = [path, _write_rows(sweep, sweep.folder / ROWS)]
    if names := shown_numbers(sweep):
        written.append(sweep_figure(_drawn(sweep.data, names), sweep.plan.fields, names, sweep.folder / FIGURE))
    return written


def _write_rows(sweep: Sweep, path: Path) -> Path:
    """Writes one row a run as CSV with a header; what there is per segment has a column for each."""
    columns: dict[str, np.ndarray] = {}
    for number in sweep.numbers:
        values = sweep.data[number.name].values.reshape(len(sweep.runs), -1)
        names = [f"{number.name}_{i}" for i in sweep.data[SEGMENT].values] if number.per_segment else [number.name]
        columns |= dict(zip(names, values.T, strict=True))
    rows = (
        [
            i,
            *_varied(sweep, i),
            run.status,
            run.reason,
            " | ".join(run.warnings),
            "" if run.outcome is None else run.outcome.path.name,
            *("" if np.isnan(values[i]) else f"{values[i]:.10g}" for values in columns.values()),
        ]
        for i, run in enumerate(sweep.runs)
    )
    seed = ["seed"] if REPEAT in sweep.plan.levels else []
    return write_csv(path, ["number", *sweep.plan.fields, *seed, "status", "reason", "warnings", "run", *columns], rows)


def shown_numbers(sweep: Sweep) -> list[str]:
    """Returns which numbers the table and the figure show: the one to rank by first, and only such as there are."""
    study, kept = sweep.plan.study, {number.name for number in sweep.numbers}
    wanted = dict.fromkeys([*([] if study.rank is None else [study.rank]), *(study.outputs or PREFERRED)])
    return [name for name in wanted if name in kept and bool(np.isfinite(sweep.data[name]).any())][:N_SHOWN]


def _drawn(data: xr.Dataset, names: Sequence[str]) -> xr.Dataset:
    """Numbers to draw, those per segment as their mean over the segments."""
    chosen = data[[*names, "status"]]
    for name in names:
        if SEGMENT in chosen[name].dims:
            text = f"{chosen[name].attrs['long_name']}, mean of segments"
            chosen[name] = chosen[name].mean(SEGMENT).assign_attrs(chosen[name].attrs | {"long_name": text})
    return chosen


def results_table(sweep: Sweep) -> Table:
    """Returns the runs with the highest and the lowest values of the first number, and those that failed and why."""
    plan, names = sweep.plan, shown_numbers(sweep)
    drawn = _drawn(sweep.data, names)
    columns = [drawn[name].values.reshape(-1) for name in names]
    content = f"highest and lowest {names[0]}" if names else "no number has a value"
    table = Table(title=f"{plan.study.name}: {content}", caption=_caption(sweep))
    heads = [worded(name.rsplit(".", 1)[-1], sweep.data[name].attrs["units"]) for name in (*plan.fields, *names)]
    n = len(plan.fields)
    for head in ("run", *heads[:n], *([REPEAT] if REPEAT in plan.levels else []), *heads[n:]):
        table.add_column(head, justify="right")
    if names:
        order = [i for i in np.argsort(-columns[0], kind="stable").tolist() if np.isfinite(columns[0][i])]
        for rows in [order] if len(order) <= 2 * N_ENDS else [order[:N_ENDS], order[-N_ENDS:]]:
            for i in rows:
                values = ("" if np.isnan(column[i]) else f"{column[i]:.4g}" for column in columns)
                table.add_row(str(i), *_varied(sweep, i), *values)
            table.add_section()
    return table


def failures(sweep: Sweep) -> list[tuple[str, list[int]]]:
    """Returns why runs failed or were stopped, and the numbers of those runs, the most frequent reason first."""
    by_reason: dict[str, list[int]] = {}
    for i, run in enumerate(sweep.runs):
        if run.status != "complete":
            by_reason.setdefault(f"{run.status}: {run.reason}", []).append(i)
    return sorted(by_reason.items(), key=lambda item: -len(item[1]))


def _caption(sweep: Sweep) -> str:
    reasons = failures(sweep)
    lines = [f"{len(sweep.runs)} runs, of which {sum(run.status == 'complete' for run in sweep.runs)} are complete"]
    if doubtful := [i for i, run in enumerate(sweep.runs) if run.warnings]:
        lines[0] += f", and {len(doubtful)} have warnings (run {_listed(doubtful)}), which {ROWS} has"
    lines += [f"{len(numbers)} {reason} (run {_listed(numbers)})" for reason, numbers in reasons[:N_FAILED]]
    if len(reasons) > N_FAILED:
        lines.append(f"{len(reasons) - N_FAILED} more reasons in {ROWS}")
    return "\n".join(lines)


def _listed(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers[:5])) + (", .." if len(numbers) > 5 else "")


def _varied(sweep: Sweep, i: int) -> list[str]:
    """Values of the varied fields of a run, and its seed where there are repeats."""
    values, case = sweep.plan.points[i]
    seed = [str(case.changes["seed"])] if REPEAT in sweep.plan.levels else []
    return [*map(label, values.values()), *seed]
