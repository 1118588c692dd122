# ruff: noqa: D301 -- the help texts need a real backspace: it keeps the lines of an example apart.
"""The command `bench`."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.entry import EXIT_INTERRUPTED, complain, end_study, lock


def bench_command(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results.")] = Path("bench"),
    quick: Annotated[bool, typer.Option("--quick", help="Fewer points, one converged run: 3 minutes.")] = False,
    cases: Annotated[
        list[str] | None,
        typer.Option("--cases", metavar="LINE", help="Only these cases; may be repeated.  [default: all]"),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no table, only the paths.")] = False,
) -> None:
    """Measure speed and error side by side.

    Times closed loops with their recording, each in a process of its own on one core, and compares their
    elongation and period with runs that are converged in time. Writes bench.json, bench.png and bench.svg:
    error against speed, cost against the number of segments, and where the time of a step goes.

    \b
    --cases levels      the levels of --fidelity
    --cases steps       physics steps of 1 to 40 ms
    --cases elements    1 to 6 elements a rhombus side
    --cases segments    rods of 3 to 30 segments
    --cases chain       the paper's formulation, 3 to 12 segments
    --cases duration    10 and 60 s, for the memory
    --cases peer        free rods of PyElastica, if it is installed

    The whole takes about 15 minutes. Leave the machine alone meanwhile: what else runs is measured too.
    Every measurement is kept in bench/cases, so a second call goes on where the first one was stopped, and
    a full run takes over what --quick measured. Delete that folder to measure again.

    \b
    annelid bench                                   everything, into the folder bench
    annelid bench --quick                           an overview
    annelid bench --cases levels -o levels          the levels of fidelity only
    annelid bench --cases segments --cases chain    how the cost grows with the worm
    """
    import json

    from annelid.experiment.progress import study_progress
    from annelid.terminal import Console
    from annelid_studies.bench.benchmark import bench
    from annelid_studies.bench.report import bench_figure, bench_table

    lock(output)
    try:
        with study_progress(quiet=quiet) as progress:
            path = bench(output, "quick" if quick else "full", lines=cases or None, progress=progress)
    except KeyboardInterrupt:
        options = [*(["--quick"] if quick else []), *(word for line in cases or () for word in ("--cases", line))]
        again = shlex.join(["annelid", "bench", "-o", str(output), *options])
        complain(f"interrupted: what was measured is kept in {output / 'cases'}; go on with: {again}")
        raise typer.Exit(EXIT_INTERRUPTED) from None
    report = json.loads(path.read_text(encoding="utf-8"))
    if not quiet:
        Console().print(bench_table(report))
    for written in (path, bench_figure(report, output / "bench")):
        typer.echo(written)
    end_study(len(report["cases"]), sum("failed" in case for case in report["cases"]), path)
