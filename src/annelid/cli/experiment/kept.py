"""What experiments of many runs share: their options, a store of the runs, and how an interrupted one goes on."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from annelid.cli.common import workers_for
from annelid.cli.entry import EXIT_INTERRUPTED, complain, lock

if TYPE_CHECKING:
    from annelid.experiment.progress import StudyProgress
    from annelid.experiment.store import Store

Output = Annotated[Path, typer.Option("--output", "-o", help="Folder of the results and the runs.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no tables, only the paths.")]


@contextmanager
def kept_runs(
    words: Sequence[str], output: Path, *, quick: bool, jobs: int | None, cluster: str | None = None, quiet: bool
) -> Iterator[tuple[Store, StudyProgress | None]]:
    """Opens a folder's store of runs with a progress display; on Ctrl-C tells how to go on.

    Args:
        words: The experiment's name and its arguments, without the options that all experiments have.
        output: The folder; runs are kept in ``runs`` below it.
        quick: As the command was given.
        jobs: As the command was given.
        cluster: As the command was given.
        quiet: No progress.

    Raises:
        ConfigError: The folder is a file.
        RunFileError: Another process writes there.
        typer.Exit: The user has interrupted it.
    """
    from annelid.experiment.progress import study_progress
    from annelid.experiment.store import Store

    lock(output)
    folder = output / "runs"
    try:
        with workers_for(cluster, jobs) as workers, study_progress(quiet=quiet) as progress:
            yield Store(folder, workers), progress
    except KeyboardInterrupt:
        options = [*(["--quick"] if quick else []), *(["--jobs", str(jobs)] if jobs else [])]
        options += ["--cluster", cluster] if cluster else []
        again = shlex.join(["annelid", "experiment", *words, "-o", str(output), *options])
        complain(f"interrupted: finished runs are kept in {folder}; go on with: {again}")
        raise typer.Exit(EXIT_INTERRUPTED) from None
