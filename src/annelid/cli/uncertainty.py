"""What `run --uncertainty` does beyond a plain run."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from annelid.cli.entry import EXIT_INTERRUPTED, complain
from annelid.errors import ConfigError

if TYPE_CHECKING:
    from annelid.config import RunConfig
    from annelid.experiment.uncertainty import Uncertainty


def run_with_error_bars(
    config: RunConfig,
    n: int,
    folder: Path,
    *,
    source: Path | None,
    vary: list[str] | None,
    jobs: int | None,
    overwrite: bool,
    quiet: bool,
    given: list[str],
) -> Uncertainty:
    """Runs a worm and its variants behind one progress bar.

    Args:
        config: The worm.
        n: How many worms are drawn about it.
        folder: Folder of the run.
        source: A ``calibration.json``, or None for annelid's own.
        vary: Each ``PARAMETER=ERROR``.
        jobs: Processes, or None for as many as there are cores.
        overwrite: Allow a folder that holds something else.
        quiet: Without progress.
        given: The words after ``annelid run`` that tell the worm, to name the command that goes on.

    Raises:
        AnnelidError: As `annelid.experiment.uncertainty.uncertainty`.
        Exit: It was interrupted; finished runs are kept.
    """
    from annelid.experiment.progress import study_progress
    from annelid.experiment.uncertainty import read_spread, uncertainty

    spread = read_spread(source).but(_errors(vary))
    try:
        with study_progress(quiet=quiet) as progress:
            return uncertainty(
                config,
                n,
                folder,
                spread=spread,
                jobs=jobs,
                overwrite=overwrite,
                progress=None if progress is None else lambda *state: progress("error bars", *state),
            )
    except KeyboardInterrupt:
        words = ["annelid", "run", *given, "--uncertainty", str(n)]
        words += [] if source is None else ["--uncertainty-from", str(source)]
        words += [word for assignment in vary or () for word in ("--vary", assignment)]
        words += [] if jobs is None else ["--jobs", str(jobs)]
        again = shlex.join([*words, "--out", str(folder)])
        complain(f"interrupted: finished runs are kept in {folder}; go on with: {again}")
        raise typer.Exit(EXIT_INTERRUPTED) from None


def report_error_bars(result: Uncertainty, *, quiet: bool) -> None:
    """Writes the files of a run with error bars, prints its table unless quiet, and names the files."""
    from annelid.experiment.uncertainty import uncertainty_table, write_uncertainty
    from annelid.terminal import Console

    paths = write_uncertainty(result)
    if not quiet:
        Console().print(uncertainty_table(result))
    for path in paths:
        typer.echo(path)


def command_words(
    preset: str | None,
    assignments: list[str] | None,
    segments: int | None,
    fidelity: str | None,
    arena: str | None,
    duration_s: float | None,
    seed: int | None,
) -> list[str]:
    """Returns the words of a command line that tell a worm; what is None was not given."""
    options = {
        "--segments": segments,
        "--fidelity": fidelity,
        "--arena": arena,
        "--duration": duration_s,
        "--seed": seed,
    }
    words = [] if preset is None else [preset]
    words += [word for assignment in assignments or () for word in ("--set", assignment)]
    return words + [word for name, value in options.items() if value is not None for word in (name, str(value))]


def _errors(vary: list[str] | None) -> dict[str, float]:
    from annelid.config import parse_assignments

    errors: dict[str, float] = {}
    for name, value in parse_assignments(vary or []).items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ConfigError(f"--vary {name}={value}: the relative error must be a number, for example {name}=0.1")
        errors[name] = float(value)
    return errors
