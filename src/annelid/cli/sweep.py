"""The command `sweep`."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.common import ClusterName, Jobs, Output, Quiet, going_on, print_results
from annelid.cli.entry import end_study, lock


def sweep_command(
    study: Annotated[
        Path | None, typer.Argument(metavar="STUDY.toml", help="What is varied, and how; --example prints one.")
    ] = None,
    output: Output = Path("sweep"),
    cluster: ClusterName = None,
    jobs: Jobs = None,
    samples: Annotated[
        int | None,
        typer.Option("--samples", min=1, max=1_000_000, help="Samples to draw.  [default: as the study has it]"),
    ] = None,
    example: Annotated[bool, typer.Option("--example", help="Print a study with comments, to begin with.")] = False,
    quiet: Quiet = False,
) -> None:
    """Vary fields over a grid or in samples, on this machine or on a cluster.

    A study names a preset, fields that are the same in every run, and fields that are varied: over numbers, choices or
    ranges, in every combination or as random, Latin hypercube or Sobol samples.

    Writes sweep.nc, one labelled dataset with every number of summary and gait; sweep.csv, a row a run; sweep.png and
    .svg. Runs are kept: a second call computes what is missing or has failed, one with more samples adds to them. A run
    that cannot be built, or whose workers die again and again, is listed with its reason, and the sweep goes on. Needs
    the extra: pip install 'annelid[sweep]'; docs/sweeps.md has several machines and Slurm. A cluster that the study
    describes is used where --cluster names the file.

    \b
    annelid sweep --example > study.toml
    annelid sweep study.toml
    annelid sweep study.toml --cluster tcp://10.0.0.1:8786
    annelid sweep study.toml --cluster study.toml
    annelid sweep study.toml --samples 512
    """
    if example:
        from importlib.resources import files

        typer.echo((files("annelid.experiment") / "sweep_example.toml").read_text(encoding="utf-8"), nl=False)
        return
    if study is None:
        raise typer.BadParameter("name a study: annelid sweep --example > study.toml  makes one to begin with")
    from annelid.config import load_study
    from annelid.experiment.progress import study_progress
    from annelid.experiment.sweep import swept
    from annelid.experiment.sweep_results import results_table, write_results

    loaded = load_study(study)
    if samples is not None:
        loaded = load_study(loaded.model_dump(by_alias=True) | {"samples": samples})
    lock(output)
    with going_on(output / "runs"), study_progress(quiet=quiet) as progress:
        to_use = f"add --cluster {shlex.quote(str(study))}"
        done = swept(loaded, output, cluster=cluster, jobs=jobs, progress=progress, to_use=to_use)
    print_results(write_results(done), results_table(done), quiet=quiet)
    failed, stopped = (sum(run.status == status for run in done.runs) for status in ("failed", "stopped"))
    end_study(len(done.runs), failed, output / "sweep.csv", stopped=stopped)
