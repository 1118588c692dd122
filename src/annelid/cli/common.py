"""What several commands share: their parameters, configurations, and what they print."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from annelid.errors import RunFileError

if TYPE_CHECKING:
    from annelid.config import RunConfig
    from annelid.simulation.runfile import Run
    from annelid.studies.workers import Workers

DEFAULT_PRESET = "riddle2023-rods"

Preset = Annotated[str | None, typer.Argument(help="Name of a preset, or a TOML file.", metavar="[PRESET|FILE.toml]")]
Assignments = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="FIELD=VALUE", help="Set any field by its dotted path; may be repeated."),
]
Segments = Annotated[int | None, typer.Option("--segments", help="Number of segments, at least 3.")]
FidelityLevel = Annotated[
    str | None,
    typer.Option(
        "--fidelity",
        metavar="LEVEL",
        help="How finely the 3D worm is resolved: paper, accurate, fast or preview (docs/speed.md has their errors)"
        "  [default: as the preset has it, fast for riddle2023-rods]",
    ),
]
ArenaName = Annotated[
    str | None,
    typer.Option(
        "--arena",
        metavar="ARENA|FILE.toml",
        help="Put the 3D worm elsewhere: a name of `annelid arenas`, or a TOML file  [default: where the preset is]",
    ),
]
Jobs = Annotated[int | None, typer.Option(min=1, help="Runs at a time.  [default: as many as there are cores]")]
ClusterName = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        metavar="WHERE",
        envvar="ANNELID_CLUSTER",
        help="Where runs are computed: processes, local (Dask on this machine), slurm, the address or the scheduler"
        " file (.json) of a Dask scheduler, or a TOML file with a table [cluster]",
    ),
]
RunPath = Annotated[Path, typer.Argument(metavar="RUN", help="A run's folder, or its run.nc.")]
Force = Annotated[bool, typer.Option("--force", help="Replace an output file that exists.")]


def workers_for(cluster: str | None, jobs: int | None) -> AbstractContextManager[Workers | None]:
    """Gives the workers of a cluster that the user names; None, for processes of this machine, where none is named.

    Raises:
        ConfigError: It names no cluster.
    """
    from annelid.config import find_cluster
    from annelid.studies.cluster import workers_of

    return nullcontext() if cluster is None else workers_of(find_cluster(cluster), jobs)


def or_default(preset: str | None, fidelity: str | None = None) -> str:
    """Returns the preset that was named, or the one that a level of fidelity comes from, or the default one."""
    # An empty name, as from an unset variable of a shell, must not pass for none.
    if preset is not None:
        return preset
    if fidelity is None:
        return DEFAULT_PRESET
    from annelid.config import find_level

    return find_level(fidelity).preset


def overrides_of(assignments: list[str] | None, **options: Any) -> dict[str, Any]:
    """Joins the assignments of ``--set`` and the options that were given; the latter win.

    Args:
        assignments: Each ``FIELD=VALUE``.
        **options: Fields by name, None where the option was left out.

    Returns:
        Values by dotted path.

    Raises:
        ConfigError: An assignment is malformed.
    """
    from annelid.config import parse_assignments

    given = {field: value for field, value in options.items() if value is not None}
    return parse_assignments(assignments or []) | given


def config_of(
    source: str,
    overrides: dict[str, Any],
    segments: int | None,
    fidelity: str | None = None,
    arena: str | None = None,
) -> RunConfig:
    """Loads a preset or a TOML file with what is changed in it.

    Raises:
        ConfigError: There is no such preset, file, level of fidelity or arena, or a value is out of range.
    """
    from annelid.config import PlanarWorm, load_config

    if segments is not None:
        planar = isinstance(load_config(source).body, PlanarWorm)
        overrides |= {"body.n_segments" if planar else "body.mesh.n_segments": segments}
    return load_config(source, overrides, fidelity=fidelity, arena=arena)


def refuse_existing(path: Path, force: bool, option: str = "-o") -> None:
    """Keeps what stands in the way of an output file that an option names.

    Raises:
        RunFileError: The path is a folder, or a file that exists and ``force`` is false.
    """
    if path.is_dir():
        raise RunFileError(f"{path} is a folder: name a file")
    if path.exists() and not force:
        raise RunFileError(f"{path} exists: name another file with {option}, or replace it with --force")


def print_table(run: Run) -> None:
    """Prints the numbers of a run, the published ones beside them."""
    from rich.console import Console

    from annelid.analysis import gait, summary
    from annelid.view.gait_table import add_gait
    from annelid.view.table import summary_table

    table = summary_table(summary(run), run.config)
    add_gait(table, gait(run))
    Console().print(table)
