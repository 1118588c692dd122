# ruff: noqa: D301 -- the help texts need a real backspace: it keeps the lines of an example apart.
"""The command line, a thin skin over the library. Heavy imports are inside the commands, so help is quick."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from annelid.errors import AnnelidError, ConfigError, RunFileError, SimulationStopped

if TYPE_CHECKING:
    from annelid.config import RunConfig
    from annelid.simulation.runfile import Run

EXIT_USAGE = 2
EXIT_STOPPED = 3
EXIT_INTERRUPTED = 130
DEFAULT_PRESET = "riddle2023"


class _Sentences(TyperGroup):
    """Ends every error a user can act on with one sentence and an exit code, never with a traceback."""

    def invoke(self, ctx: Any) -> Any:
        """Runs the command."""
        try:
            return super().invoke(ctx)
        except SimulationStopped as stop:
            _complain(stop)
            raise typer.Exit(EXIT_STOPPED) from None
        except AnnelidError as error:
            _complain(error)
            raise typer.Exit(EXIT_USAGE) from None
        except BrokenPipeError:
            raise
        except RuntimeError as error:
            # What the engine says on import to a back-end it does not know.
            if "MUJOCO_GL" not in str(error):
                raise
            _complain(error)
            raise typer.Exit(EXIT_USAGE) from None
        except OSError as error:
            where = f"{error.filename}: " if error.filename else ""
            _complain(f"{where}{error.strerror or error}")
            raise typer.Exit(EXIT_USAGE) from None
        except MemoryError:
            _complain("there is not enough memory for this: try fewer segments, or a smaller picture")
            raise typer.Exit(EXIT_USAGE) from None
        except ArithmeticError as error:
            _complain(f"a number is too large or too small to compute with: {str(error) or type(error).__name__}")
            raise typer.Exit(EXIT_USAGE) from None
        except KeyboardInterrupt:
            _complain("interrupted")
            raise typer.Exit(EXIT_INTERRUPTED) from None


app = typer.Typer(
    cls=_Sentences,
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)

Preset = Annotated[str | None, typer.Argument(help="Name of a preset, or a TOML file.", metavar="[PRESET|FILE.toml]")]
Assignments = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="FIELD=VALUE", help="Set any field by its dotted path; may be repeated."),
]
Segments = Annotated[int | None, typer.Option("--segments", help="Number of segments, at least 3.")]
RunPath = Annotated[Path, typer.Argument(metavar="RUN", help="A run's folder, or its run.nc.")]
Force = Annotated[bool, typer.Option("--force", help="Replace an output file that exists.")]


def main() -> None:
    """Entry point of the command ``annelid``."""
    app(prog_name="annelid")


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"annelid {version('annelid')}")
        raise typer.Exit


@app.callback()
def _start(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Simulate a soft, peristaltic earthworm robot driven by a synthetic nervous system.

    \b
    annelid run                        run the paper's worm: about a minute
    annelid run riddle2022-planar      run the planar worm: a few seconds
    annelid paper                      reproduce and examine the whole paper: about 40 minutes
    annelid presets                    what else there is
    annelid doctor                     is everything in place?
    """


@app.command()
def run(
    preset: Preset = None,
    assignments: Assignments = None,
    segments: Segments = None,
    duration: Annotated[float | None, typer.Option(help="Simulated time, s.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of every random draw.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the results  [default: runs/NAME-NNN, the next free number]")
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option(metavar="RUN", help="Continue this run from where it ended; --duration counts from its start."),
    ] = None,
    video: Annotated[bool, typer.Option("--video/--no-video", help="Draw a video at the end.")] = True,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bars and no table.")] = False,
) -> None:
    """Run a worm, draw it and print its numbers.

    Writes run.nc, figure7.png, frame.png and video.mp4, and prints a table.

    \b
    annelid run                                              the paper's worm
    annelid run riddle2023-rods --segments 4                 four segments, the fast formulation
    annelid run riddle2023-rods --set arena.friction=0.3     any field of any preset
    annelid run my.toml --duration 20 --out long             your own file, your own folder
    annelid run --resume long --duration 40                  twenty seconds more
    """
    from annelid.simulation.loop import simulate
    from annelid.view.gallery import draw_all

    overrides = _overrides(assignments, duration_s=duration, seed=seed)
    if resume is None:
        config = _config(_or_default(preset), overrides, segments)
    elif preset is None and segments is None:
        config = _config_to_continue(resume, overrides)
    else:
        raise typer.BadParameter("--resume continues a run as it is: give no preset and no --segments with it")
    with _run_folder(out, config.name) as folder:
        try:
            done = simulate(config, folder, resume=resume, progress=False if quiet else None)
        except SimulationStopped as stop:
            raise SimulationStopped(f"{stop}{_show_what_is_left(folder, quiet)}") from None
    if not quiet:
        _print_table(done)
    if done.status == "interrupted":
        _complain(f"interrupted: what was computed is in {done.path}; continue it with: annelid run --resume {folder}")
        raise typer.Exit(EXIT_INTERRUPTED)
    typer.echo(done.path)
    for path in draw_all(done, folder, video=video, quiet=quiet, complain=_complain):
        typer.echo(path)


@app.command()
def build(
    preset: Preset = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="The MJCF file to write.")] = Path("worm.xml"),
    assignments: Assignments = None,
    segments: Segments = None,
    force: Force = False,
) -> None:
    """Write a worm and its arena as MJCF, for plain MuJoCo.

    \b
    annelid build riddle2023-rods -o worm.xml
    annelid build riddle2023-rods --segments 6 --set body.mesh.radius_m=0.1 -o thin.xml
    """
    from annelid.body import build_spec
    from annelid.view.output import whole_file

    _refuse_existing(output, force)
    config = _config(_or_default(preset), _overrides(assignments), segments)
    spec = build_spec(config)
    try:
        spec.compile()
    except ValueError as error:
        raise ConfigError(f"the engine refuses this body: {str(error).splitlines()[0]}") from None
    with whole_file(output) as draft:
        draft.write_text(spec.to_xml(), encoding="utf-8")
    typer.echo(output)


@app.command()
def show(
    run: RunPath,
    as_json: Annotated[bool, typer.Option("--json", help="Print the numbers as JSON, in SI units.")] = False,
) -> None:
    """Print the numbers of a run.

    Beside them stand the published ones, where there are any.

    \b
    annelid show runs/riddle2023-001
    annelid show runs/riddle2023-001 --json | jq .period_s
    """
    from annelid.analysis import summary
    from annelid.simulation.runfile import open_run

    opened = open_run(run)
    if as_json:
        typer.echo(summary(opened).to_json())
        return
    _print_table(opened)
    if opened.message:
        typer.echo(opened.message)


@app.command()
def plot(
    run: RunPath,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Picture to write: .png, .pdf, .svg  [default: figure7.png in the run]"),
    ] = None,
    force: Force = False,
) -> None:
    """Draw potentials and lengths over time.

    The counterpart of the paper's figure 7.

    \b
    annelid plot runs/riddle2023-001 -o figure7.pdf
    """
    from annelid.simulation.runfile import open_run
    from annelid.view.plots import figure7, plot_path

    opened = open_run(run)
    if output is None:
        target = opened.path.parent / "figure7.png"
    else:
        target = plot_path(output)
        _refuse_existing(target, force)
    typer.echo(figure7(opened, target))


@app.command()
def render(
    run: RunPath,
    at: Annotated[float | None, typer.Option("--time", help="Draw one frame at this time, s.")] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Frame to write: .png, .jpg  [default: frame.png in the run]")
    ] = None,
    video: Annotated[Path | None, typer.Option(help="Draw a video: .mp4, .mov, .mkv")] = None,
    fps: Annotated[float, typer.Option(help="Frames a second of the video, 1 to 240.")] = 25.0,
    speed: Annotated[float, typer.Option(help="Simulated seconds a second of video.")] = 1.0,
    camera: Annotated[str | None, typer.Option(help="isometric, side, top or front  [default: isometric]")] = None,
    force: Force = False,
) -> None:
    """Draw a frame or a video of a run.

    Both come from the recorded postures: later, and on any machine.

    \b
    annelid render runs/riddle2023-001 --time 1.5 -o frame.png
    annelid render runs/riddle2023-001 --video slow.mp4 --speed 0.25
    annelid render runs/riddle2023-001 --time 1.5 --camera side -o side.png
    """
    from annelid.simulation.runfile import open_run
    from annelid.view.gallery import video_bar
    from annelid.view.render import render_frame, render_video

    if video is None and at is None:
        raise typer.BadParameter("say what to draw: --time SECONDS for a frame, --video FILE for a video")
    if output is not None and at is None:
        raise typer.BadParameter("-o names the frame, so it needs --time SECONDS as well")
    opened = open_run(run)
    for target in (output, video):
        if target is not None:
            _refuse_existing(target, force)
    frame = opened.path.parent / "frame.png" if output is None else output
    if at is not None:
        typer.echo(render_frame(opened, at, frame, camera=camera))
    if video is not None:
        with video_bar() as progress:
            render_video(opened, video, fps=fps, speed=speed, camera=camera, progress=progress)
        typer.echo(video)


@app.command("limit-cycle")
def limit_cycle_command(
    preset: Preset = None,
    assignments: Assignments = None,
    segments: Segments = None,
    neuron: Annotated[
        str, typer.Option(help="The cycle begins when this neuron's potential rises through the threshold.")
    ] = "contraction_1",
    threshold: Annotated[
        float | None, typer.Option(help="Threshold, mV above rest.  [default: half the operating range]")
    ] = None,
    times: Annotated[
        list[str] | None,
        typer.Option("--time", metavar="WAY", help="continuous, located or stepped; may be repeated.  [default: all]"),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Picture to write: .png, .pdf, .svg  [default: none]")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the numbers and the phase response curves as JSON, in SI units.")
    ] = False,
    force: Force = False,
) -> None:
    """Find a planar worm's limit cycle, and how stable it is.

    Follows the worm until its states repeat, then disturbs each state a little at a hundred points of the
    cycle. Prints the period and the Floquet multipliers: what one cycle leaves of a deviation. All but one
    below 1 in magnitude: the rhythm comes back by itself; the one at 1 is a shift in time, which stays.

    Time is taken in three ways: continuous, for the multipliers; located, in the worm's own steps, but each
    ended where a stretch sensor switches; and stepped, in its own steps as they are in a run. The picture
    shows the phase response too: by how much a kick of a neuron, at each phase, advances the rhythm.
    Takes about ten seconds for 3 segments, twenty for 6; default preset: riddle2022-planar.

    \b
    annelid limit-cycle riddle2022-planar --segments 6
    annelid limit-cycle riddle2022-planar --time continuous -o cycle.png
    annelid limit-cycle --set controller.gate_time_constant_ms=200 --set body.gain=1.9
    annelid limit-cycle --json | jq .continuous.multipliers[0]
    """
    import json
    from typing import cast, get_args

    from rich.console import Console

    from annelid.analysis.limit_cycle import Time, limit_cycle
    from annelid.view.cycle_table import HEADINGS, cycle_numbers, cycle_table
    from annelid.view.figures.limit_cycle import limit_cycle_figure
    from annelid.view.plots import plot_path

    if output is not None:
        output = plot_path(output)
        _refuse_existing(output, force)
    config = _config("riddle2022-planar" if preset is None else preset, _overrides(assignments), segments)
    ways = cast(list["Time"], times or list(get_args(Time)))
    cycles = {way: limit_cycle(config, time=way, neuron=neuron, threshold_mV=threshold) for way in ways}
    if as_json:
        typer.echo(json.dumps({"name": config.name, "n_segments": config.body.n_segments} | cycle_numbers(cycles)))
    else:
        Console().print(cycle_table(f"{config.name}, {config.body.n_segments} segments", cycles))
    if output is not None:
        named = {HEADINGS[way]: cycle for way, cycle in cycles.items()}
        typer.echo(limit_cycle_figure(named, output), err=as_json)


@app.command()
def paper(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the report.")] = Path("report"),
    quick: Annotated[bool, typer.Option("--quick", help="Coarser maps, the same claims: about 5 minutes.")] = False,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="NAME", help="Only this examination, and the main numbers; may be repeated."),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Runs at a time.  [default: as many as there are cores]")
    ] = None,
    claims: Annotated[
        Path | None, typer.Option(metavar="FILE.md", help="Write the table of claims there as well, as Markdown.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress, only the paths.")] = False,
) -> None:
    """Reproduce the paper's figures and claims, and examine them.

    Writes report.html, one file with all pictures to read and to send, and report.md beside its figures.
    The whole takes about 40 minutes on two cores, --quick about 5. Every run is kept in report/runs, so
    a second call takes seconds, and a killed one goes on where it was.

    \b
    annelid paper                                      the whole, into the folder report
    annelid paper --quick -o draft                     the same claims from coarser maps
    annelid paper --only pins --only friction          these examinations only
    annelid paper -o report --claims docs/paper.md     and the table of claims for the repository
    """
    from annelid.studies.paper import reproduce
    from annelid.studies.progress import study_progress
    from annelid.studies.report import claims_page, write_report
    from annelid.view.output import whole_file, with_suffix

    if output.exists() and not output.is_dir():
        raise RunFileError(f"{output} is a file: name a folder with -o")
    if claims is not None:
        if only:
            raise typer.BadParameter("--claims needs the whole report, so leave --only out")
        claims = with_suffix(claims, (".md",), "Markdown", default=".md")
        if not claims.parent.is_dir():
            raise RunFileError(f"{claims} cannot be written: there is no folder {claims.parent}")
    try:
        with study_progress(quiet=quiet) as progress:
            report = reproduce(output, "quick" if quick else "full", only=only or None, jobs=jobs, progress=progress)
            html = write_report(report, output)
    except KeyboardInterrupt:
        options = [*(["--quick"] if quick else []), *(word for name in only or () for word in ("--only", name))]
        options += ["--jobs", str(jobs)] if jobs else []
        options += ["--claims", str(claims)] if claims else []
        again = shlex.join(["annelid", "paper", "-o", str(output), *options])
        _complain(f"interrupted: finished runs are kept in {output / 'runs'}; go on with: {again}")
        raise typer.Exit(EXIT_INTERRUPTED) from None
    if claims is not None:
        with whole_file(claims) as draft:
            draft.write_text(claims_page(report), encoding="utf-8")
    for path in (html, html.with_suffix(".md"), claims):
        if path is not None:
            typer.echo(path)


@app.command()
def presets(
    name: Annotated[str | None, typer.Argument(help="Print this preset's commented TOML.")] = None,
    fields: Annotated[bool, typer.Option("--fields", help="List every field with its meaning.")] = False,
) -> None:
    """List the presets, or print one.

    What it prints is a start for a file of your own.

    \b
    annelid presets
    annelid presets riddle2023 > my.toml
    annelid presets riddle2023 --fields
    """
    from rich.console import Console

    from annelid.config import load_config, preset_names, preset_text
    from annelid.view.table import field_lines, presets_table

    if name is not None and not fields:
        typer.echo(preset_text(name), nl=False)
        return
    if fields:
        typer.echo("\n".join(field_lines(load_config(_or_default(name)))))
        return
    Console().print(presets_table([load_config(each) for each in preset_names()]))


@app.command()
def doctor() -> None:
    """Tell what is missing and how to install it.

    \b
    annelid doctor
    """
    from annelid.view.doctor import examine

    for finding in examine():
        typer.echo(finding.line())


def _complain(what: object) -> None:
    typer.echo(f"annelid: {' '.join(str(what).split())}", err=True)


def _or_default(preset: str | None) -> str:
    # An empty name, as from an unset variable of a shell, must not pass for none.
    return DEFAULT_PRESET if preset is None else preset


def _overrides(assignments: list[str] | None, **options: Any) -> dict[str, Any]:
    from annelid.config import parse_assignments

    given = {field: value for field, value in options.items() if value is not None}
    return parse_assignments(assignments or []) | given


def _config(source: str, overrides: dict[str, Any], segments: int | None) -> RunConfig:
    from annelid.config import PlanarWorm, load_config

    if segments is not None:
        planar = isinstance(load_config(source).body, PlanarWorm)
        overrides |= {"body.n_segments" if planar else "body.mesh.n_segments": segments}
    return load_config(source, overrides)


def _config_to_continue(path: Path, overrides: dict[str, Any]) -> RunConfig:
    from annelid.config import load_config
    from annelid.simulation.runfile import open_run

    return load_config(open_run(path).config.model_dump(), overrides)


@contextmanager
def _run_folder(out: Path | None, name: str) -> Iterator[Path]:
    """Yields the folder to run into; what was made for a numbered one and stayed empty is removed."""
    if out is not None:
        yield out
        return
    parent = Path("runs")
    first = not parent.exists()
    folder = _next_free(parent, re.sub(r"[^\w.-]+", "-", name).strip("-.") or "run")
    try:
        yield folder
    finally:
        with suppress(OSError):
            folder.rmdir()
            if first:
                parent.rmdir()


def _next_free(parent: Path, name: str) -> Path:
    """Makes and returns the folder with the next number; making it keeps it from runs that start together."""
    parent.mkdir(exist_ok=True)
    numbered = re.compile(re.escape(name) + r"-(\d+)")
    taken = [int(match[1]) for entry in parent.iterdir() if (match := numbered.fullmatch(entry.name))]
    number = max(taken, default=0) + 1
    while True:
        folder = parent / f"{name}-{number:03d}"
        try:
            folder.mkdir()
        except FileExistsError:
            number += 1
        else:
            return folder


def _refuse_existing(path: Path, force: bool) -> None:
    if path.is_dir():
        raise RunFileError(f"{path} is a folder: name a file")
    if path.exists() and not force:
        raise RunFileError(f"{path} exists: name another file with -o, or replace it with --force")


def _print_table(run: Run) -> None:
    from rich.console import Console

    from annelid.analysis import summary
    from annelid.view.table import summary_table

    Console().print(summary_table(summary(run), run.config))


def _show_what_is_left(folder: Path, quiet: bool) -> str:
    """Prints the table of a run that a guard stopped; returns the words that name its file."""
    from annelid.simulation.runfile import FILE_NAME, open_run

    if not (folder / FILE_NAME).exists():
        return ""
    left = open_run(folder)
    if not quiet:
        _print_table(left)
    return f"; what was computed is in {left.path}"
