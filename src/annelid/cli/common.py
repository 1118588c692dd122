"""What several commands share: their parameters, configurations, and what they print."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Annotated, Any

import typer

from annelid.cli.entry import EXIT_INTERRUPTED, complain, lock, remark, typed_command
from annelid.cli.json_output import give_files, records, wants_json
from annelid.errors import ConfigError, RunFileError
from annelid.text import LINE

if TYPE_CHECKING:
    from rich.table import Table

    from annelid.config import RunConfig
    from annelid.experiment.convergence import Check
    from annelid.experiment.store import Store
    from annelid.live import Plot
    from annelid.simulation.runfile import Run

FIRST_PRESET, RIGID_PRESET = "riddle2023-fast", "riddle2023-rods"
"""The paper's worm, with its soft crossings, which runs where no preset is named, and with rigid crossings."""


def presets_from(typed: str) -> list[str]:
    """Completes the name of a preset, for the shell."""
    from annelid.config import preset_names

    return [name for name in preset_names() if name.startswith(typed)]


def arenas_from(typed: str) -> list[str]:
    """Completes the name of an arena, for the shell."""
    from annelid.config import arena_names

    return [name for name in arena_names() if name.startswith(typed)]


def runs_from(typed: str) -> list[str]:
    """Completes the folder of a run, for the shell: of those in ``runs`` and beside what was typed."""
    beside = Path(typed) if typed.endswith("/") else Path(typed).parent
    found = {str(path.parent) for folder in (Path("runs"), beside) for path in folder.glob("*/run.nc")}
    return sorted(path for path in found if path.startswith(typed))


def worms_from(typed: str) -> list[str]:
    """Completes a preset or the folder of a run, for the shell."""
    return presets_from(typed) + runs_from(typed)


WORM = "Name of a preset, a TOML file, or a robot as MJCF (.xml)."

Preset = Annotated[
    str | None,
    typer.Argument(
        help=f"{WORM}  [default: {FIRST_PRESET}]",
        metavar="[PRESET|FILE.toml]",
        autocompletion=presets_from,
    ),
]
NamedPreset = Annotated[str, typer.Argument(help=WORM, metavar="[PRESET|FILE.toml]", autocompletion=presets_from)]
Assignments = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="FIELD=VALUE",
        help="Set any field by its dotted path, in the unit at the end of its name; may be repeated.",
    ),
]
Segments = Annotated[int | None, typer.Option("--segments", help="Number of segments, at least 3.")]
FidelityLevel = Annotated[
    str | None,
    typer.Option(
        "--fidelity",
        metavar="LEVEL",
        help="Resolution of a 3D worm of rods: accurate, fast or preview; docs/evidence/speed.md has their errors"
        "  [default: the preset's]",
    ),
]
ArenaName = Annotated[
    str | None,
    typer.Option(
        "--arena",
        metavar="ARENA|FILE.toml|FILE.xml",
        autocompletion=arenas_from,
        help="Where the 3D worm crawls: a name of `annelid list arenas`, a TOML file, or a scene as MJCF (.xml)"
        "  [default: the preset's]",
    ),
]
Jobs = Annotated[
    int | None, typer.Option(min=1, max=4096, help="Runs at a time.  [default: as many as there are cores]")
]
Output = Annotated[Path, typer.Option("--output", "-o", help="Folder of the results and the runs.")]
ResultsFolder = Annotated[Path, typer.Option("--output", "-o", help="Folder of the results.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no tables, only the paths.")]
OnlyPaths = Annotated[bool, typer.Option("--quiet", "-q", help="No progress, only the paths.")]
RunPath = Annotated[
    Path, typer.Argument(metavar="RUN", help="A run's folder, or its run.nc.", autocompletion=runs_from)
]
Force = Annotated[bool, typer.Option("--force", help="Replace an output file that exists.")]


@contextmanager
def kept_runs(output: Path, *, jobs: int | None, quiet: bool) -> Iterator[Store]:
    """Gives the store of a study's runs, ``runs`` in its folder, with its workers and its progress display.

    Other writers are kept out of the folder.

    Args:
        output: Folder of the study's results.
        jobs: Runs at a time, or None.
        quiet: Whether progress is not shown.
    """
    from annelid.experiment.executors import Processes
    from annelid.experiment.progress import study_progress
    from annelid.experiment.store import Store

    lock(output)
    with going_on(output / "runs"), Processes(jobs) as executor, study_progress(quiet=quiet) as progress:
        yield Store(output / "runs", executor, progress=progress)


@contextmanager
def going_on(folder: Path, *further: str, kept: str = "finished runs are kept") -> Iterator[None]:
    """Says on Ctrl-C what is kept in a folder, and the command that goes on: the one given, with further words.

    Args:
        folder: The folder.
        further: Words that the command which goes on needs beside those that were given.
        kept: What is kept.

    Raises:
        Exit: On Ctrl-C.
    """
    try:
        yield
    except KeyboardInterrupt:
        complain(f"interrupted: {kept} in {folder}; go on with:", typed_command(*further))
        raise typer.Exit(EXIT_INTERRUPTED) from None


def overrides_of(assignments: list[str] | None, **options: Any) -> dict[str, Any]:
    """Joins the assignments of ``--set`` and the options that were given, which win, as values by dotted path.

    Args:
        assignments: As given, each ``field=value``.
        options: Values of options by their fields; None where one was not given.
    """
    from annelid.config import parse_assignments

    given = {field: value for field, value in options.items() if value is not None}
    return parse_assignments(assignments or []) | given


def config_of(
    preset: str | None,
    overrides: dict[str, Any],
    segments: int | None = None,
    fidelity: str | None = None,
    arena: str | None = None,
) -> RunConfig:
    """Loads a preset or a TOML file with what is changed in it; where none is named, that of the first run.

    Args:
        preset: A preset or file, or None.
        overrides: Values by dotted path.
        segments: Number of segments.
        fidelity: Level of fidelity.
        arena: Where the worm is put.

    Raises:
        ConfigError: Something is not allowed; or no worm is named for options that do not suit that of the first run.
    """
    from annelid.config import load_config

    # An empty name, as from an unset variable of a shell, must not pass for none.
    source = FIRST_PRESET if preset is None else preset
    for option, value in {"--segments": segments, "--fidelity": fidelity}.items():
        if preset is None and value is not None:
            fitted = f"{FIRST_PRESET}, which runs where no worm is named, is fitted to three segments and its mesh"
            raise ConfigError(f"{option} {value}: {fitted}; next: {typed_command(RIGID_PRESET)}")
    if segments is not None:
        overrides |= {load_config(source).body.segments_field: segments}
    config = load_config(source, overrides, fidelity=fidelity, arena=arena)
    _say_unchanged(config, overrides, source, fidelity, arena)
    return config


def _say_unchanged(
    config: RunConfig, overrides: Mapping[str, Any], source: str, fidelity: str | None, arena: str | None
) -> None:
    """Says which fields were set to the value that they have without it."""
    from annelid.config import field_value, fields_of, load_config, toml_value, whole_path

    if not overrides:
        return
    try:
        without = load_config(source, fidelity=fidelity, arena=arena)
    except ConfigError:
        return  # Only what is set makes it valid.
    for path in (whole_path(given, config.model_dump()) for given in overrides):
        if path in fields_of(config) and path in fields_of(without):
            value = field_value(config, path)
            if value == field_value(without, path):
                remark(f"note: {path} = {toml_value(value)} changes nothing: {source} has this value")


def names_worm(source: str) -> bool:
    """Returns whether a word names a worm, as a preset or a file, and no run: a run that is there comes first.

    Args:
        source: As the user gave it.
    """
    from annelid.config import preset_names
    from annelid.simulation.runfile import FILE_NAME

    path = Path(source)
    return not (path / FILE_NAME).exists() and (source in preset_names() or path.suffix in (".toml", ".xml"))


def refuse_existing(path: Path, force: bool, option: str = "-o") -> None:
    """Raises `RunFileError` where an output file exists without --force, or cannot be written; an option names it.

    Args:
        path: The file.
        force: Whether it may be replaced.
        option: Option that names the file, for the message.

    Raises:
        RunFileError: It exists, or cannot be written.
    """
    if path.is_dir():
        raise RunFileError(f"{path} is a folder: name a file")
    if path.exists() and not force:
        named = f" with {option}" if option else ""
        raise RunFileError(f"{path} exists: name another file{named}, or replace it with --force")
    # A device or a pipe is written as it is, a file by way of a draft beside it.
    written = path if path.exists() and not path.is_file() else path.parent
    if not written.exists():
        raise RunFileError(f"{path} cannot be written: there is no folder {written}")
    if not os.access(written, os.W_OK):
        raise RunFileError(f"{path} cannot be written: {written} does not allow it")


def print_results(
    paths: Iterable[Path], *tables: Table | str, quiet: bool, results: Mapping[str, Any] | None = None
) -> None:
    """Prints the tables and sentences of a study unless it is to be quiet, and the paths of its files.

    With --json these are the paths and what the files hold, and further results by name.

    Args:
        paths: The files.
        tables: Tables and sentences.
        quiet: Whether only the paths are printed.
        results: Further results by name, for --json.
    """
    from annelid.terminal import Console

    written = list(paths)
    if wants_json():
        give_files((), {**records(written), **(results or {})})
    else:
        for table in () if quiet else tables:
            Console().print(table, soft_wrap=isinstance(table, str))
    print_paths(written)


def print_paths(paths: Iterable[Path]) -> None:
    """Prints the paths of files that were written, a line each, or in the document of --json."""
    written = list(paths)
    if not give_files(written):
        for path in written:
            typer.echo(path)


def print_worm(config: RunConfig, *, quiet: bool = False) -> None:
    """Prints in a line which worm it is, unless it is to be quiet.

    Args:
        config: Its configuration.
        quiet: Whether nothing is printed.
    """
    if not quiet and not wants_json():
        size = f", {config.body.n_segments} segments, {config.duration_s:g} s"
        # What a summary has in brackets is how long it takes to compute.
        what = f"{config.name}: {config.summary.partition(' (')[0]}".removesuffix(": ")
        while len(what) > LINE - len(size) and ", " in what:
            what = what.rpartition(", ")[0]
        typer.echo(shorten(what, LINE - len(size), placeholder=" ..") + size)


def print_run(
    run: Run, *, everything: bool = False, quiet: bool = False, check: Check | None = None, note: str = ""
) -> None:
    """Prints the numbers of a run unless it is to be quiet, those to compare with beside them, and what follows.

    A check adds how far each number moves, and its sentence at the end.

    Args:
        run: The run.
        everything: All numbers; else what is asked first.
        quiet: Whether nothing is printed.
        check: What finer runs have found.
        note: A further sentence.
    """
    from annelid.analysis import summary
    from annelid.draw.summary_table import closing_sentence, duration_for_a_speed, legend, summary_table
    from annelid.terminal import Console

    numbers = summary(run)
    checked = {} if check is None else {"check.json": check.to_dict()}
    if give_files([run.path], {run.path.name: numbers.to_dict(), **checked}) or quiet:
        return
    moved = None if check is None else check.cell
    lines = [summary_table(numbers, run.config, everything=everything, moved=moved), legend(numbers, run.config)]
    lines += [f"warning: {doubt}" for doubt in numbers.warnings]
    lines += [closing_sentence(numbers, run.config), "" if check is None else check.sentence, note]
    if not everything:
        folder = shlex.quote(str(run.path.parent))
        duration_s = duration_for_a_speed(numbers)
        longer = f", or run it with --duration {duration_s}" if duration_s else ""
        lines += [f"all numbers: annelid show {folder} --all; words: --explain ROW"]
        lines += [f"next: annelid view {folder}{longer}"]
    Console().print("\n".join(line for line in lines if line))


def play(
    worm: RunConfig | Run,
    *,
    host: str = "127.0.0.1",
    port: int | None = None,
    speed: float = 1.0,
    open_browser: bool = True,
    plots: Mapping[str, Plot] | None = None,
) -> None:
    """Shows a worm or a run in the browser until Ctrl-C.

    Args:
        worm: A configuration to run, or a run to play.
        host: Address to listen on.
        port: Port, 0 for any that is free; None for the usual one or the next free.
        speed: Simulated seconds a second at the start.
        open_browser: Whether to open the page.
        plots: Further plots beside the worm, by their names.
    """
    import webbrowser

    from annelid.live.server import free_port, warning_of
    from annelid.live.show import Show

    if (warning := warning_of(host)) is not None:
        remark(f"warning: {warning}")
    with Show(worm, host=host, port=free_port(host, port), speed=speed, plots=plots) as show:
        typer.echo(f"{show.address}  (Ctrl-C ends)")
        if open_browser:
            webbrowser.open(show.address)
        try:
            show.run()
        except KeyboardInterrupt:
            typer.echo("")
