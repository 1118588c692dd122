"""The command `compare`: runs side by side, or a run and a measured log."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from annelid.cli import (
    Force,
    command,
    complain,
    config_of,
    give,
    lock,
    locked_folder,
    names_worm,
    play,
    print_paths,
    refuse_existing,
    remark,
    runs_from,
    wants_json,
)
from annelid.errors import ConfigError, RunFileError

ANIMALS = "earthworm"
"""Stands for the animals and published robots, unless a run has this name."""


@command("compare", "Robot")
def compare_command(
    runs: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="RUN RUN..",
            autocompletion=runs_from,
            show_default=False,
            help="Folders of runs, or their run.nc; differences are to the first. With --map: a run and a log. Before"
            " `earthworm` also presets.",
        ),
    ] = None,
    log_map: Annotated[
        Path | None,
        typer.Option(
            "--map", metavar="MAP.toml", help="Compare with a measured log; the map says what its columns are."
        ),
    ] = None,
    map_for: Annotated[
        Path | None, typer.Option("--map-for", metavar="LOG", help="Print a map for a log, to complete and edit.")
    ] = None,
    from_time: Annotated[float, typer.Option(help="With --map: compare from this time of the run on, s.")] = 0.0,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder for the figures and comparison.json  [default: only print]"),
    ] = None,
    view: Annotated[
        bool, typer.Option("--view", help="With --map: play the run in the browser, with the log beside it.")
    ] = False,
    everything: Annotated[bool, typer.Option("--all", help="Print all numbers, not only what is asked first.")] = False,
    force: Force = False,
) -> None:
    """Compare runs with each other, or a run with a measured log.

    Prints the main numbers of every run (with --all all of them), their differences to the first run, and the fields
    in which the configurations differ. A dash means that the run lacks the number, so worms of any kinds can be
    compared. With -o it draws all runs into one figure each: lengths.png and travel.png.

    \b
    annelid compare runs/riddle2023-rods-001 runs/riddle2023-rods-002
    annelid compare runs/first runs/second -o comparison
    annelid compare runs/* --json | jq .numbers.period_s
    annelid compare --map-for robot.csv > robot.toml
    annelid compare runs/wang-001 robot.csv --map robot.toml -o robot
    annelid compare runs/wang-001 robot.csv --map robot.toml --view
    annelid compare runs/wang-001 earthworm -o animals   beside animals
    annelid compare crawler-servo earthworm              runs the preset first

    With --map the second file is a measured log: CSV, Parquet, MATLAB, netCDF, or the points of a video tracker. Run
    and log are aligned in time. The table has error, amplitude, phase and duty of every signal, and -o adds
    agreement.json and agreement.png. docs/how_to/measured_data.md describes the map and the numbers.

    The last word `earthworm` puts runs, or presets that it runs first, beside an earthworm, a fly larva and published
    robots: speed, stride, frequency, anchored share, with sources. -o adds earthworm.json and earthworm.png.
    """
    runs = runs or []
    if map_for is not None:
        if runs or log_map or output or view:
            raise typer.BadParameter("--map-for takes a log alone: annelid compare --map-for LOG > MAP.toml")
        from annelid_lab.logs import proposed_map

        proposal, missing = proposed_map(map_for)
        typer.echo(proposal, nl=False)
        for one in missing:
            complain(f"state {one}")
        return
    if log_map is not None:
        _compare_measured(runs, log_map, from_time, output, force=force, view=view)
        return
    if view:
        raise typer.BadParameter("--view needs --map: annelid view RUN plays a run alone")
    if runs and str(runs[-1]) == ANIMALS and not runs[-1].exists():
        _compare_animals(runs[:-1], output, force=force)
        return
    from annelid.analysis import compare
    from annelid.draw import comparison_table, fields_table, lengths_figure, travel_figure
    from annelid.output import write_json
    from annelid.simulation import open_run

    if len(runs) == 2 and runs[1].is_file() and runs[1].suffix != ".nc" and ".toml" not in (one.suffix for one in runs):
        _propose_map(*runs)
    if len(runs) < 2:
        raise typer.BadParameter("name at least two runs to compare")
    figures = {"lengths.png": lengths_figure, "travel.png": travel_figure}
    if output is not None:
        lock(output)
        for name in ("comparison.json", *figures):
            refuse_existing(output / name, force)
    opened = [open_run(run) for run in runs]
    comparison = compare(opened)
    if not give(comparison.to_dict()):
        typer.echo(comparison_table(comparison, everything=everything))
        typer.echo(f"\n{fields_table(comparison) if comparison.fields else 'the configurations are the same'}")
    if output is None:
        if not wants_json():
            typer.echo("next: all numbers with --all, figures of the runs with -o FOLDER")
        return
    written = [write_json(output / "comparison.json", comparison.to_dict())]
    for name, draw in figures.items():
        try:
            written.append(draw(opened, comparison.labels, output / name))
        except RunFileError as error:
            complain(f"{name} not drawn: {error}")
    print_paths(written)


def _compare_animals(worms: list[Path], output: Path | None, *, force: bool) -> None:
    from annelid.output import write_json
    from annelid.simulation import Run, open_run, simulate
    from annelid_lab.animals import animals_picture, animals_record, animals_table, limits, published, subject_of

    if output is not None:
        lock(output)
        for suffix in ("json", "png"):
            refuse_existing(output / f"{ANIMALS}.{suffix}", force)
    runs: list[Run] = []
    for worm in worms:
        if not names_worm(str(worm)):
            runs.append(open_run(worm))
            continue
        config = config_of(str(worm), {})
        runs.append(simulate(config, locked_folder(None, config.name)))
        complain(f"{worm}: run in {runs[-1].path}")
    own = [subject_of(run, run.path.absolute().parent.name) for run in runs]
    for one in own:
        if not one.numbers:
            remark(f"note: {one.name} has no complete cycle behind its first one: run it longer, with --duration")
    subjects = [*own, *published()]
    sentences = list(dict.fromkeys(filter(None, map(limits, runs))))
    record = {**animals_record(subjects), "limits": sentences}
    if not give(record):
        typer.echo("\n\n".join([animals_table(subjects), *sentences]))
    if output is not None:
        print_paths([write_json(output / f"{ANIMALS}.json", record), animals_picture(subjects, output / ANIMALS)])


def _propose_map(run: Path, log: Path) -> NoReturn:
    """Writes a map for a log that came without one, and says how to go on."""
    from annelid.output import write_text
    from annelid_lab.logs import proposed_map

    own = Path(f"{log.name.partition('.')[0]}.map.toml")
    go_on = f"annelid compare {shlex.quote(str(run))} {shlex.quote(str(log))} --map {shlex.quote(str(own))}"
    if own.exists():
        raise ConfigError(f"a log needs a map, and there is {own}: {go_on}")
    proposal, missing = proposed_map(log)
    write_text(own, proposal)
    to_do = f"state in it {'; '.join(missing)}" if missing else "check it"
    raise ConfigError(f"a log needs a map of its columns. {own} is a proposal: {to_do}. Then: {go_on}")


def _compare_measured(
    files: list[Path], log_map: Path, from_s: float, output: Path | None, *, force: bool, view: bool
) -> None:
    from annelid.output import write_json
    from annelid.simulation import open_run
    from annelid_lab.logs import compare_with_log, read_map, read_measured
    from annelid_lab.logs.report import agreement_figure, agreement_table, measured_plots

    if len(files) != 2:
        raise typer.BadParameter("--map compares one run with one measured table: name both")
    if output is not None:
        lock(output)
        for name in ("agreement.json", "agreement.png"):
            refuse_existing(output / name, force)
    run = open_run(files[0])
    found = compare_with_log(run, read_measured(files[1], read_map(log_map)), from_s=from_s)
    if not give(found.to_dict()):
        typer.echo(agreement_table(found))
    for note in found.notes:
        remark(f"note: {note}")
    if output is not None:
        print_paths([write_json(output / "agreement.json", found.to_dict())])
        print_paths([agreement_figure(found, output / "agreement")])
    if view:
        play(run, plots=measured_plots(found))
