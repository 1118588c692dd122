# ruff: noqa: D301 -- the help texts need a real backspace: it keeps the lines of an example apart.
"""The command `paper`."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.common import ClusterName, Jobs, workers_for
from annelid.cli.entry import EXIT_INTERRUPTED, complain, lock
from annelid.errors import RunFileError


def paper_command(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the report.")] = Path("report"),
    quick: Annotated[bool, typer.Option("--quick", help="Coarser maps, the same claims: about 6 minutes.")] = False,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="NAME", help="Only this examination, and the main numbers; may be repeated."),
    ] = None,
    jobs: Jobs = None,
    cluster: ClusterName = None,
    claims: Annotated[
        Path | None, typer.Option(metavar="FILE.md", help="Write the table of claims there as well, as Markdown.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress, only the paths.")] = False,
) -> None:
    """Reproduce the paper's figures and claims, and examine them.

    Writes report.html, one file with all pictures to read and to send, and report.md beside its figures.
    The whole takes about an hour on two cores, --quick about 6 min. Every run is kept in report/runs, so
    a second call takes seconds, and a killed one goes on where it was.

    \b
    annelid paper                                      the whole, into the folder report
    annelid paper --quick -o draft                     the same claims from coarser maps
    annelid paper --only pins --only friction          these examinations only
    annelid paper -o report --claims docs/paper.md     and the table of claims for the repository
    """
    from annelid.experiment.progress import study_progress
    from annelid.output import whole_file, with_suffix
    from annelid_studies.riddle2023.paper import reproduce
    from annelid_studies.riddle2023.report import claims_page, write_report

    lock(output)
    if claims is not None:
        if only:
            raise typer.BadParameter("--claims needs the whole report, so leave --only out")
        claims = with_suffix(claims, (".md",), "Markdown", default=".md")
        if not claims.parent.is_dir():
            raise RunFileError(f"{claims} cannot be written: there is no folder {claims.parent}")
    try:
        with workers_for(cluster, jobs) as workers, study_progress(quiet=quiet) as progress:
            effort = "quick" if quick else "full"
            report = reproduce(output, effort, only=only or None, jobs=jobs, workers=workers, progress=progress)
            html = write_report(report, output)
    except KeyboardInterrupt:
        options = [*(["--quick"] if quick else []), *(word for name in only or () for word in ("--only", name))]
        options += ["--jobs", str(jobs)] if jobs else []
        options += ["--cluster", cluster] if cluster else []
        options += ["--claims", str(claims)] if claims else []
        again = shlex.join(["annelid", "paper", "-o", str(output), *options])
        complain(f"interrupted: finished runs are kept in {output / 'runs'}; go on with: {again}")
        raise typer.Exit(EXIT_INTERRUPTED) from None
    if claims is not None:
        with whole_file(claims) as draft:
            draft.write_text(claims_page(report), encoding="utf-8")
    for path in (html, html.with_suffix(".md"), claims):
        if path is not None:
            typer.echo(path)
