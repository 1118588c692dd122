# ruff: noqa: D301 -- the help texts need a real backspace: it keeps the lines of an example apart.
"""The commands `experiment ..`: what is done to a worm on a bench."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.common import (
    Assignments,
    FidelityLevel,
    Force,
    Preset,
    config_of,
    or_default,
    overrides_of,
    refuse_existing,
)
from annelid.cli.entry import EXIT_INTERRUPTED, complain
from annelid.errors import RunFileError

experiment = typer.Typer(no_args_is_help=True, help="Do an experiment on a worm's body.")


@experiment.callback()
def _experiments() -> None:
    """Do an experiment on a worm's body."""


@experiment.command("load-frame")
def load_frame_command(
    preset: Preset = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results.")] = Path("load-frame"),
    assignments: Assignments = None,
    fidelity: FidelityLevel = None,
    displacement: Annotated[float, typer.Option(help="How far the cable is wound, mm.")] = 330.0,
    speed: Annotated[float, typer.Option(help="Speed of the cable, mm/s.")] = 10.0,
    cable_friction: Annotated[
        float, typer.Option(help="Friction of the cable: coefficient times the angle it is wrapped round, rad.")
    ] = 0.0,
    data: Annotated[
        Path | None, typer.Option("--data", help="Measured loop to compare with.  [default: the one of annelid]")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no table, only the paths.")] = False,
    force: Force = False,
) -> None:
    """Close one ring by its cable and open it again.

    The middle ring of a weightless worm is wound in slowly and let out; the cable's force is compared with what
    the authors measured on one segment of the robot. A few seconds. Writes load_frame.csv, .png and .svg.

    \b
    annelid experiment load-frame
    annelid experiment load-frame --set body.strands.young_modulus_Pa=1e9 --set body.joints.dry_friction_Nm=0.01
    """
    from rich.console import Console

    from annelid.studies.calibration.frame import load_frame
    from annelid.studies.calibration.loop import MM, cable_force, read_loop
    from annelid.studies.calibration.report import frame_table, write_loop
    from annelid.studies.progress import study_progress
    from annelid.view.figures.load_frame import load_frame_figure

    table = output / "load_frame.csv"
    if output.is_dir():
        refuse_existing(table, force)
    measured = read_loop(data)
    config = config_of(or_default(preset, fidelity), overrides_of(assignments), None, fidelity)
    with study_progress(quiet=quiet) as progress:
        tension = load_frame(
            config,
            displacement_m=displacement * MM,
            speed_m_per_s=speed * MM,
            progress=None if progress is None else lambda share: progress("load frame", 0, 0, share),
        )
    loop = cable_force(tension, cable_friction)
    output.mkdir(parents=True, exist_ok=True)
    if not quiet:
        Console().print(frame_table({config.name: loop, "measured": measured}))
    write_loop(loop, tension, table)
    loops = {config.name: (loop.displacement_m, loop.force_N), "measured": (measured.displacement_m, measured.force_N)}
    for path in (table, load_frame_figure(loops, table.with_suffix(""))):
        typer.echo(path)


@experiment.command("weak-middle")
def weak_middle_command(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results and the runs.")] = Path(
        "weak-middle"
    ),
    quick: Annotated[bool, typer.Option("--quick", help="Worms of 3 and 4 segments and two values a sweep.")] = False,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Runs at a time.  [default: as many as there are cores]")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no tables, only the paths.")] = False,
) -> None:
    """Find out why the middle of the worm elongates less than its ends.

    Every segment of a resting worm (preset wang with the authors' rods and springs) is pulled alone, wound in and held
    until it stands still; the deficit is how far the interior segments stay below the two ends, on average. Swept one
    at a time: number of segments, Young's modulus, weight, friction; each with four kinds of actuators. Force-limited:
    a servo that stalls at a tension. Servo: one that stalls, or ends at its shortest cable. Muscle: the paper's, whose
    force falls with its length. Length-limited: wound to a length, whatever that takes. Then: which differences
    between two interior segments would make them elongate as the robot's, 3.82 and 4.78 cm.

    Writes weak_middle.csv, .png and .svg, and keeps runs, so that a second call takes seconds and an interrupted one
    goes on. About 250 runs of some seconds each; docs/weak_middle.md explains the results.

    \b
    annelid experiment weak-middle --quick
    annelid experiment weak-middle -o weak-middle
    """
    from rich.console import Console

    from annelid.studies.progress import study_progress
    from annelid.studies.store import Store
    from annelid.studies.weak_middle.asymmetry import asymmetry
    from annelid.studies.weak_middle.results import (
        asymmetry_table,
        checks_table,
        panels,
        papers_deficit,
        robot_deficit,
        settings_table,
        sweep_table,
        write_readings,
    )
    from annelid.studies.weak_middle.sweeps import BASE_KEY, QUANTITIES, weak_middle
    from annelid.view.figures.weak_middle import weak_middle_figure

    if output.exists() and not output.is_dir():
        raise RunFileError(f"{output} is a file: name a folder with -o")
    store, found = Store(output / "runs"), None
    try:
        with study_progress(quiet=quiet) as progress:
            set_to, readings = weak_middle(store, "quick" if quick else "full", jobs=jobs, progress=progress)
            if not quick:
                found = asymmetry(store, set_to[BASE_KEY].force_N, jobs=jobs, progress=progress)
    except KeyboardInterrupt:
        words = ["annelid", "experiment", "weak-middle", "-o", str(output), *(["--quick"] if quick else [])]
        again = shlex.join([*words, *(["--jobs", str(jobs)] if jobs else [])])
        complain(f"interrupted: finished runs are kept in {store.folder}; go on with: {again}")
        raise typer.Exit(EXIT_INTERRUPTED) from None
    if not quiet:
        tables = [settings_table(set_to), *(sweep_table(readings, quantity) for quantity in QUANTITIES)]
        tables += [checks_table(readings), asymmetry_table(found)] if found else []
        for table in tables:
            Console().print(table)
    path = output / "weak_middle.csv"
    write_readings([*readings, *(found.readings if found else ())], path)
    marks = {"robot": robot_deficit(), "paper's\nmodel": papers_deficit()}
    for written in (path, weak_middle_figure(panels(readings), marks, path.with_suffix(""))):
        typer.echo(written)


@experiment.command("turning")
def turning_command(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results and the runs.")] = Path(
        "turning"
    ),
    quick: Annotated[bool, typer.Option("--quick", help="The strongest modulation to either side only.")] = False,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Runs at a time.  [default: as many as there are cores]")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no table, only the paths.")] = False,
) -> None:
    """Find out on which radius the worm turns.

    The authors' six-segment robot with half-rings crawls on flat ground under constant modulations of its two sides,
    with three gaits: the timed pattern 3x1 with all segments modulated alike, the same with the middle segments bent
    the other way, and the nervous system with ideal muscles.

    Writes turning.csv, .png and .svg, and keeps runs, so that a second call takes seconds and an interrupted one goes
    on. 21 runs of some seconds to a minute each; docs/turning.md explains the results.

    \b
    annelid experiment turning --quick
    annelid experiment turning -o turning
    """
    from rich.console import Console

    from annelid.studies.progress import study_progress
    from annelid.studies.store import Store
    from annelid.studies.turning import MODULATIONS, QUICK, turning, turning_picture, turning_table, write_readings

    if output.exists() and not output.is_dir():
        raise RunFileError(f"{output} is a file: name a folder with -o")
    store = Store(output / "runs")
    try:
        with study_progress(quiet=quiet) as progress:
            turned = turning(store, QUICK if quick else MODULATIONS, jobs=jobs, progress=progress)
    except KeyboardInterrupt:
        words = ["annelid", "experiment", "turning", "-o", str(output), *(["--quick"] if quick else [])]
        again = shlex.join([*words, *(["--jobs", str(jobs)] if jobs else [])])
        complain(f"interrupted: finished runs are kept in {store.folder}; go on with: {again}")
        raise typer.Exit(EXIT_INTERRUPTED) from None
    if not quiet:
        Console().print(turning_table(turned.readings))
    path = write_readings(turned.readings, output / "turning.csv")
    for written in (path, turning_picture(turned, path.with_suffix(""))):
        typer.echo(written)


@experiment.command("speed")
def speed_command(
    gaits: Annotated[
        list[str] | None,
        typer.Argument(metavar="[PRESET|FILE.toml]...", help="Gaits.  [default: riddle2025-muscles and crawler]"),
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results and the runs.")] = Path("speed"),
    quick: Annotated[bool, typer.Option("--quick", help="Two values of each quantity.")] = False,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Runs at a time.  [default: as many as there are cores]")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no tables, only the paths.")] = False,
) -> None:
    """Find out how fast gaits crawl over friction and number of segments.

    Every gait crawls on ground of friction 0.05 to 1.5, and with 3 to 12 segments, whose inner rings are all as strong
    as its second. Speed, stride, period, cost of transport and slip are those of whole cycles.

    Writes speed.csv, .png and .svg, and keeps runs, so that a second call takes seconds and an interrupted one goes
    on. Some 15 runs a gait of about ten seconds each; docs/speed_of_travel.md explains the results.

    \b
    annelid experiment speed --quick
    annelid experiment speed
    annelid experiment speed crawler tune/best.toml -o mine
    """
    from rich.console import Console

    from annelid.studies.crawling import GAITS, VALUES, crawl, crawling_table, points, write_figure, write_readings
    from annelid.studies.progress import study_progress
    from annelid.studies.store import Store

    if output.exists() and not output.is_dir():
        raise RunFileError(f"{output} is a file: name a folder with -o")
    store = Store(output / "runs")
    try:
        with study_progress(quiet=quiet) as progress:
            readings = crawl(store, points(gaits or GAITS, "quick" if quick else "full"), jobs=jobs, progress=progress)
    except KeyboardInterrupt:
        words = ["annelid", "experiment", "speed", *(gaits or []), "-o", str(output), *(["--quick"] if quick else [])]
        again = shlex.join([*words, *(["--jobs", str(jobs)] if jobs else [])])
        complain(f"interrupted: finished runs are kept in {store.folder}; go on with: {again}")
        raise typer.Exit(EXIT_INTERRUPTED) from None
    if not quiet:
        for quantity in VALUES:
            Console().print(crawling_table(readings, quantity))
    path = output / "speed.csv"
    write_readings(readings, path)
    for written in (path, write_figure(readings, path.with_suffix(""))):
        typer.echo(written)


@experiment.command("pipes")
def pipes_command(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results and the runs.")] = Path("pipes"),
    quick: Annotated[bool, typer.Option("--quick", help="The taper with two gaits, and one bend.")] = False,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Runs at a time.  [default: as many as there are cores]")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no table, only the paths.")] = False,
) -> None:
    """Find out which pipes the worm passes, and how fast.

    The six-segment worm with ideal muscles goes through a taper and an hourglass down to a radius of 0.13 m: with one
    nervous system whose wave keeps its pace, adapts it to the pressure on the worm's back, or is fast throughout; with
    the paper's nervous system, and with the timed pattern 3x1. And round bends of 90 degrees with that pattern, the
    same turning away from contact, the paper's nervous system and the robust one. Speeds are those along the pipe's
    centre line.

    Writes pipes.csv, .png and .svg, and keeps runs, so that a second call takes seconds and an interrupted one goes on.
    22 runs of half a minute to three minutes each; docs/pipes.md explains the results.

    \b
    annelid experiment pipes --quick
    annelid experiment pipes -o pipes
    """
    from rich.console import Console

    from annelid.studies.pipes import pass_pipes, pipes_picture, pipes_table, trials, write_readings
    from annelid.studies.progress import study_progress
    from annelid.studies.store import Store

    if output.exists() and not output.is_dir():
        raise RunFileError(f"{output} is a file: name a folder with -o")
    store = Store(output / "runs")
    try:
        with study_progress(quiet=quiet) as progress:
            found = pass_pipes(store, trials(quick), jobs=jobs, progress=progress)
    except KeyboardInterrupt:
        words = ["annelid", "experiment", "pipes", "-o", str(output), *(["--quick"] if quick else [])]
        again = shlex.join([*words, *(["--jobs", str(jobs)] if jobs else [])])
        complain(f"interrupted: finished runs are kept in {store.folder}; go on with: {again}")
        raise typer.Exit(EXIT_INTERRUPTED) from None
    if not quiet:
        Console().print(pipes_table(found.readings))
    path = write_readings(found.readings, output / "pipes.csv")
    for written in (path, pipes_picture(found, path.with_suffix(""))):
        typer.echo(written)
