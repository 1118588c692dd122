"""The command `cite`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from annelid.errors import ConfigError, suggest

if TYPE_CHECKING:
    from annelid.config import RunConfig


def cite(
    source: Annotated[
        str | None,
        typer.Argument(
            metavar="[RUN|PRESET|FILE.toml]", help="What was used  [default: only annelid and the paper behind it]"
        ),
    ] = None,
    everything: Annotated[bool, typer.Option("--all", help="Print every entry that annelid knows.")] = False,
) -> None:
    """Print BibTeX of what a run or a preset rests on.

    Above each entry stands what it is cited for. Fields that annelid does not know for certain are left out, and
    the entry's note says which to complete.

    \b
    annelid cite
    annelid cite runs/riddle2023-rods-001 > references.bib
    annelid cite wang
    annelid cite --all
    """
    from annelid.references import bibtex, entries, references_of

    if everything and source is not None:
        raise typer.BadParameter("--all prints every entry: name no run or preset with it")
    references = entries() if everything else references_of(None if source is None else _config(source))
    typer.echo(bibtex(list(references) if everything else references), nl=False)


def _config(source: str) -> RunConfig:
    """Reads the configuration of a run, a TOML file or a preset, in this order where a name is all of them.

    Raises:
        ConfigError: It is none of them.
        RunFileError: It is a path, but of no run.
    """
    from annelid.config import load_config, preset_names
    from annelid.simulation.runfile import FILE_NAME, read_config

    path = Path(source)
    if (path / FILE_NAME).exists() or (path.exists() and not source.endswith(".toml") and source not in preset_names()):
        return read_config(path)
    if source.endswith(".toml") or source in preset_names():
        return load_config(source)
    raise ConfigError(f"{source!r} is neither a run nor a preset: {suggest(source, preset_names())}")
