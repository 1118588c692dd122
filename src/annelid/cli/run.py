"""The command `run`."""

from __future__ import annotations

import os
import re
import shlex
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer

from annelid.cli.common import (
    ArenaName,
    Assignments,
    FidelityLevel,
    Preset,
    Segments,
    config_of,
    going_on,
    overrides_of,
    print_paths,
    print_results,
    print_run,
    print_worm,
)
from annelid.cli.entry import EXIT_INTERRUPTED, command, complain, end_study, lock, remark
from annelid.cli.json_output import wants_json
from annelid.errors import ConfigError, RunFileError, SimulationStopped


@command("run", "Make")
def run_command(
    preset: Preset = None,
    assignments: Assignments = None,
    segments: Segments = None,
    fidelity: FidelityLevel = None,
    arena: ArenaName = None,
    network: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.toml",
            help="A network of your own as the controller; annelid export-network PRESET --to toml writes one.",
        ),
    ] = None,
    duration: Annotated[float | None, typer.Option(help="Simulated time, s.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of every random draw.")] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder for the results  [default: runs/NAME-NNN, the next free number]"),
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option(metavar="RUN", help="Continue this run from its end; --duration counts from its start."),
    ] = None,
    uncertainty: Annotated[
        int | None,
        typer.Option(
            min=2,
            max=10_000,
            metavar="N",
            help="Give the numbers error bars: from N Monte Carlo samples, finer steps and more elements.",
        ),
    ] = None,
    uncertainty_from: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Errors of the parameters: a calibration.json of annelid calibrate  [default: annelid's own]",
        ),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PARAMETER=ERROR",
            help="Relative error of a parameter: floor_friction=0.2 is 20 %; 0 leaves it out; may be repeated.",
        ),
    ] = None,
    check: Annotated[
        bool,
        typer.Option(
            "--check",
            help="Run it also at half the step and with one more element, and show how far each number moves.",
        ),
    ] = False,
    jobs: Annotated[
        int | None,
        typer.Option(min=1, max=4096, help="Runs at a time with --check, --uncertainty  [default: as many as cores]"),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the run that is in the folder.")] = False,
    video: Annotated[bool, typer.Option("--video/--no-video", help="Draw a video at the end.")] = True,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bars and no table.")] = False,
) -> None:
    """Run a worm, draw it and print its numbers.

    Writes run.nc, figure7.png, frame.png and video.mp4, and prints a table.

    \b
    annelid run                                the paper's worm, in seconds
    annelid run riddle2023                     its own formulation: a minute
    annelid run riddle2023-rods --segments 4   four segments, rigid crossings
    annelid run --set arena.friction=0.3       any field of any preset
    annelid run --arena pipe.bend              another place: annelid list arenas
    annelid run my.toml --duration 20 -o long  your own file, your own folder
    annelid run --resume long --duration 40    twenty seconds more
    annelid run riddle2023-rods --check        how well it is resolved

    --check repeats the run at half the step, and with one more element per side. The table then says how far each
    number moves, and marks changes above 10 %. check.json has both changes. This takes about four times as long as the
    run.

    --uncertainty N prints every number with its error, and writes uncertainty.json, .csv and .png. It runs N worms,
    drawn with the errors and correlations of a fit to the load frame. It also repeats the run at a half and a quarter
    of the physics step, and with one and two more elements per side. All runs are kept below the folder, so the same
    command with the same --out continues where it was stopped (docs/uncertainty.md).

    \b
    annelid run riddle2023-rods --uncertainty 8 -o walk    12 runs, seconds each
    annelid run wang --uncertainty 8 -o wang               several minutes
    annelid run wang --uncertainty 8 --vary floor_friction=0.2
    annelid run wang --uncertainty 8 --uncertainty-from mine/calibration.json
    """
    from annelid.config import load_config
    from annelid.plausibility import refuse_nonsense
    from annelid.simulation.loop import simulate
    from annelid.simulation.runfile import FILE_NAME, open_run
    from annelid.textfiles import read_text

    if uncertainty is None and (uncertainty_from, vary) != (None, None):
        raise typer.BadParameter("--uncertainty-from and --vary need --uncertainty N")
    if uncertainty is None and not check and jobs is not None:
        raise typer.BadParameter("--jobs needs --check or --uncertainty N")
    if check and uncertainty is not None:
        raise typer.BadParameter("--uncertainty has what --check does: leave out --check")
    if (check or uncertainty is not None) and resume is not None:
        raise typer.BadParameter(
            f"{'--check' if check else '--uncertainty'} makes whole runs: it does not go with --resume"
        )

    overrides = overrides_of(assignments, duration_s=duration, seed=seed)
    if network is not None:
        overrides |= {"controller.kind": "network", "controller.text": read_text(network, "the network")}
    if resume is None:
        config = config_of(preset, overrides, segments, fidelity, arena)
    elif (preset, segments, fidelity, arena, network) == (None,) * 5:
        config = load_config(open_run(resume).config.model_dump(), overrides)
    else:
        raise typer.BadParameter(
            "--resume continues a run as it is: give no preset, --segments, --fidelity, --arena, --network"
        )
    for doubt in refuse_nonsense(config):
        remark(f"warning: {doubt}")
    folder = locked_folder(out, config.name)
    print_worm(config, quiet=quiet)
    result, checked = None, None
    try:
        if check or uncertainty is not None:
            from annelid.experiment import uncertainty as error_bars
            from annelid.experiment.convergence import check as check_run
            from annelid.experiment.progress import study_progress

            spread = error_bars.read_spread(uncertainty_from).but(_errors(vary))
            further = ["--out", str(folder)] if out is None else []
            try:
                with going_on(folder, *further), study_progress(quiet=quiet) as shown:
                    how: dict[str, Any] = {"jobs": jobs, "overwrite": force, "progress": shown}
                    if uncertainty is None:
                        _, checked = check_run(config, folder, **how)
                    else:
                        result = error_bars.uncertainty(config, uncertainty, folder, spread=spread, **how)
            except typer.Exit:
                # Interrupted: the run itself may be done.
                with suppress(RunFileError):
                    if (left := open_run(folder)).config == config:
                        missing = "no error bars" if uncertainty is not None else "step and mesh are not checked"
                        print_run(left, quiet=quiet, note=f"interrupted: {missing}, since finer runs are not done")
                        print_paths([left.path])
                raise
            done = open_run(folder)
        else:
            progress = False if quiet else _lines(config.duration_s)
            done = simulate(config, folder, resume=resume, progress=progress, overwrite=force)
    except SimulationStopped as stop:
        if not (folder / FILE_NAME).exists():
            raise
        left = open_run(folder)
        print_run(left, quiet=quiet)
        raise SimulationStopped(f"{stop}; what was computed is in {left.path}") from None
    print_run(done, quiet=quiet, check=checked)
    if done.status == "interrupted":
        go_on = f"annelid run --resume {shlex.quote(str(folder))}"
        complain(f"interrupted: what was computed is in {done.path}; continue it with:", go_on)
        raise typer.Exit(EXIT_INTERRUPTED)
    if quiet and not wants_json():
        print_paths([done.path])
    if result is not None:
        from annelid.experiment.uncertainty import uncertainty_table, write_uncertainty

        print_results(write_uncertainty(result), uncertainty_table(result), quiet=quiet)
    # Only now: what draws is not to be loaded before the table.
    from annelid.draw.gallery import draw_all

    drawn = draw_all(done, folder, video=video, quiet=quiet, complain=complain)
    if quiet or wants_json():
        print_paths(drawn)
    else:
        typer.echo(f"files in {folder}: {' '.join(path.name for path in (done.path, *drawn))}")
    if result is not None:
        failed, stopped = (sum(one.status == status for *_, one in result.runs) for status in ("failed", "stopped"))
        end_study(len(result.runs), failed, folder / "uncertainty.json", stopped=stopped)


def _lines(end_s: float) -> Callable[[float, float], object] | None:
    """Returns what writes a line on stderr every ten seconds of a run; None on a terminal, which gets a bar."""
    from annelid.experiment.progress import Lines

    if sys.stderr.isatty():
        return None
    lines = Lines(sys.stderr, at_once=False)
    return lambda simulated_s, _: lines(f"simulating {end_s:g} s", 0, 0, simulated_s / end_s)


def _errors(vary: list[str] | None) -> dict[str, float]:
    """Reads relative errors, each ``PARAMETER=ERROR``."""
    from annelid.config import parse_assignments

    errors: dict[str, float] = {}
    for name, value in parse_assignments(vary or []).items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ConfigError(f"--vary {name}={value}: the relative error must be a number, for example {name}=0.1")
        errors[name] = float(value)
    return errors


def locked_folder(out: Path | None, name: str) -> Path:
    """Returns the folder to run into, or a new one with the next number, which this command alone writes.

    Args:
        out: The folder that was named, or None.
        name: Of the worm, which begins the name of a new folder.
    """
    if out is not None:
        lock(out)
        return out
    parent = Path("runs")
    name = re.sub(r"[^\w.-]+", "-", name).strip("-.") or "run"
    numbered = re.compile(re.escape(name) + r"-(\d+)")
    entries: list[str] = []
    with suppress(FileNotFoundError):
        entries = os.listdir(parent)
    number = max((int(match[1]) for entry in entries if (match := numbered.fullmatch(entry))), default=0) + 1
    while True:
        folder = parent / f"{name}-{number:03d}"
        try:
            lock(folder, new=True)
        except FileExistsError:
            number += 1
        else:
            return folder
