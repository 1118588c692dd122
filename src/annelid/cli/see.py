"""The commands on finished runs: `show`, `draw`, `view`, `export` and `cite`."""

from __future__ import annotations

from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Annotated

import typer

from annelid.cli.common import (
    RIGID_PRESET,
    ArenaName,
    Assignments,
    FidelityLevel,
    Force,
    RunPath,
    Segments,
    config_of,
    names_worm,
    overrides_of,
    play,
    print_paths,
    print_run,
    print_worm,
    refuse_existing,
    runs_from,
    worms_from,
)
from annelid.cli.entry import command, lock
from annelid.cli.json_output import give, refuse_json
from annelid.errors import ConfigError, RunFileError, suggest
from annelid.text import LINE

if TYPE_CHECKING:
    from annelid.config import RunConfig
    from annelid.simulation.runfile import Run


@command("show", "See")
def show_command(
    run: Annotated[
        Path | None, typer.Argument(metavar="RUN", help="A run's folder, or its run.nc.", autocompletion=runs_from)
    ] = None,
    everything: Annotated[bool, typer.Option("--all", help="Print all numbers, not only what is asked first.")] = False,
    explain: Annotated[
        str | None, typer.Option(metavar="ROW", help="Only say what this row or column of the tables means.")
    ] = None,
    verify: Annotated[
        bool, typer.Option("--verify", help="Only check whether any byte of the file has changed since the run ended.")
    ] = False,
) -> None:
    """Print the numbers of a run.

    Published numbers stand beside them where there are any. docs/reference/numbers.md explains all of them.

    A run that has ended contains a digest of all its bytes. Files up to 64 MB are compared with it whenever they are
    opened, larger ones only with --verify.

    \b
    annelid show runs/riddle2023-001
    annelid show runs/riddle2023-001 --all
    annelid show --explain "cost of transport"
    annelid show runs/riddle2023-001 --json | jq .period_s
    annelid show runs/riddle2023-001 --verify
    """
    from annelid.analysis import summary
    from annelid.simulation.runfile import open_run, verify_run

    refuse_json(verify, "--verify")
    if explain is not None:
        from annelid.draw.summary_table import explained

        rows = explained(explain)
        if not give([dict(zip(("row", "name", "meaning"), row, strict=True)) for row in rows]):
            for heading, name, meaning in rows:
                typer.echo(fill(f"{heading}: {meaning}{f'; in Python and --json {name}' if name else ''}", LINE))
        return
    if run is None:
        raise typer.BadParameter("name a run, such as runs/riddle2023-fast-001: annelid list runs lists them")
    if verify:
        typer.echo(verify_run(run))
        return
    opened = open_run(run)
    if give(summary(opened).to_dict()):
        return
    print_worm(opened.config)
    print_run(opened, everything=everything)
    if opened.message:
        typer.echo(opened.message)


@command("draw", "See")
def draw_command(
    run: RunPath,
    figure: Annotated[
        str | None,
        typer.Option(
            metavar="FIGURE",
            help="figure7: potentials and lengths; track: the path, seen from above; network: neurons and synapses."
            "  [default: figure7, unless a frame or a video is drawn]",
        ),
    ] = None,
    at: Annotated[float | None, typer.Option("--time", help="Draw one frame at this time, s.")] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Figure or frame to write  [default: FIGURE.png or frame.png in the run]"),
    ] = None,
    video: Annotated[Path | None, typer.Option(help="Draw a video: .mp4, .mov, .mkv, .gif")] = None,
    fps: Annotated[float, typer.Option(help="Frames per second of the video, 1 to 240.")] = 25.0,
    speed: Annotated[float, typer.Option(help="Simulated seconds per second of video.")] = 1.0,
    camera: Annotated[
        str | None, typer.Option(help="isometric, side, top, front or course  [default: isometric]")
    ] = None,
    background: Annotated[
        str | None, typer.Option(help="white or dark, for papers and slides  [default: a floor with squares of 10 cm]")
    ] = None,
    force: Force = False,
) -> None:
    """Draw a run: a figure, a frame or a video.

    Figures are .png, .pdf or .svg. figure7 has potentials and lengths, as in the paper. track has the paths of the
    worm's middle and front, with its outline at several times. network has the neurons and synapses of the controller,
    and their potentials below. Frames are drawn from the recorded postures, so this works later and on any machine.
    Those of a 3D worm have a legend, the time and a scale bar, which is right at the distance of the worm's middle.

    \b
    annelid draw runs/riddle2023-001 -o figure7.pdf
    annelid draw runs/riddle2025-001 --figure track
    annelid draw runs/riddle2023-001 --figure network -o network.svg
    annelid draw runs/riddle2023-001 --time 1.5 --camera side -o side.png
    annelid draw runs/riddle2023-001 --video slow.mp4 --speed 0.25
    annelid draw runs/riddle2023-001 --time 1.5 --background white -o white.png
    """
    from annelid.draw.gallery import VIDEO_TASK, task_bar
    from annelid.draw.notebook import plot
    from annelid.draw.plots import plot_path
    from annelid.draw.render import render_frame, render_video
    from annelid.simulation.runfile import open_run

    if figure is not None and at is not None and output is not None:
        raise typer.BadParameter("-o names one picture: draw --figure and --time by two commands")
    if figure is None and at is None and video is None:
        figure = "figure7"
    if output is not None and figure is None and at is None:
        raise typer.BadParameter("-o names the figure or the frame: it needs --figure FIGURE or --time SECONDS as well")
    opened = open_run(run)
    if figure is not None and output is not None:
        output = plot_path(output)
    for target in (output, video):
        if target is not None:
            refuse_existing(target, force)
    if figure is not None:
        print_paths([plot(opened, output, figure=figure).path])
    frame = opened.path.parent / "frame.png" if output is None else output
    if at is not None:
        print_paths([render_frame(opened, at, frame, camera=camera, background=background)])
    if video is not None:
        with task_bar(VIDEO_TASK) as progress:
            render_video(opened, video, fps=fps, speed=speed, camera=camera, background=background, progress=progress)
        print_paths([video])


@command("view", "See", as_json=False)
def view_command(
    source: Annotated[
        str | None,
        typer.Argument(
            metavar="[PRESET|FILE.toml|RUN]",
            help="A worm to run, or a run's folder or run.nc to play.",
            autocompletion=worms_from,
        ),
    ] = None,
    assignments: Assignments = None,
    segments: Segments = None,
    fidelity: FidelityLevel = None,
    arena: ArenaName = None,
    speed: Annotated[float, typer.Option(min=0.05, max=10.0, help="Simulated seconds per second at the start.")] = 1.0,
    export: Annotated[
        Path | None,
        typer.Option(metavar="FILE.html", help="Write one HTML page that plays the run from disk, and show nothing."),
    ] = None,
    open_browser: Annotated[bool, typer.Option("--open/--no-open", help="Open the page in the browser.")] = True,
    host: Annotated[
        str,
        typer.Option(help="Address to listen on; with 0.0.0.0 other machines that know the token can open the page."),
    ] = "127.0.0.1",
    port: Annotated[
        int | None,
        typer.Option(min=0, max=65535, help="Port; 0 for any free one  [default: 8080, or any if it is taken]"),
    ] = None,
    force: Force = False,
) -> None:
    """Watch a worm in the browser as it runs, or play a run.

    The page shows the mesh, ring muscles coloured by activation, springs coloured by strain, forces of the ground, and
    the last five seconds of the neurons. Sliders change friction, stiffness, sensors and drive of the running worm; a
    click pokes it. A recorded run is played in the same page. It needs viser: pip install "annelid[view]". Nothing is
    loaded from the network, and only this machine can open the page unless --host is given. Ctrl-C ends it.

    \b
    annelid view                                         riddle2023-rods, live
    annelid view riddle2025-adaptive --arena pipe.taper  in a narrowing pipe
    annelid view --set arena.friction=0.3 --speed 0.5    changed, slow motion
    annelid view runs/riddle2023-rods-001                a recorded run
    annelid view runs/riddle2023-rods-001 --export walk.html  a page to send
    annelid compare RUN robot.csv --map robot.toml --view  with a robot's log
    """
    worm: RunConfig | Run
    if source and not names_worm(source) and Path(source).exists():
        from annelid.simulation.runfile import open_run

        if (assignments, segments, fidelity, arena) != (None, None, None, None):
            raise typer.BadParameter("a run is played as it was: give no --set, --segments, --fidelity or --arena")
        worm = open_run(source)
    else:
        preset = RIGID_PRESET if source is None else source
        worm = config_of(preset, overrides_of(assignments), segments, fidelity, arena)
    if export is not None:
        from annelid.draw.gallery import task_bar
        from annelid.live.page import export_page, page_path

        page = page_path(export)
        refuse_existing(page, force, "--export")
        with task_bar("writing the page") as progress:
            typer.echo(export_page(worm, page, speed=speed, progress=progress))
        return
    play(worm, host=host, port=port, speed=speed, open_browser=open_browser)


@command("export", "Exchange")
def export_command(
    source: Annotated[
        str,
        typer.Argument(
            metavar="RUN|PRESET|FILE.toml",
            help="A run's folder or run.nc; for mjcf also a worm, or a robot as MJCF (.xml).",
            autocompletion=worms_from,
        ),
    ],
    to: Annotated[str, typer.Option(metavar="FORMAT", help="csv, mat, parquet, nwb, wcon, html or mjcf.")],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="File to write, or folder of csv and parquet  [default: in the run]"),
    ] = None,
    signals: Annotated[
        str | None,
        typer.Option(metavar="NAME,NAME,..", help="Only these signals (csv, mat, parquet, nwb)  [default: all]"),
    ] = None,
    every: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=10_000_000,
            metavar="N",
            help="Only every Nth sample, and every Nth frame (csv, mat, parquet, nwb, wcon).",
        ),
    ] = None,
    from_time: Annotated[float | None, typer.Option(metavar="SECONDS", help="From this time on, s (not mjcf).")] = None,
    to_time: Annotated[float | None, typer.Option(metavar="SECONDS", help="Up to this time, s (not mjcf).")] = None,
    assignments: Assignments = None,
    segments: Segments = None,
    fidelity: FidelityLevel = None,
    arena: ArenaName = None,
    force: Force = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar.")] = False,
) -> None:
    """Write a run for other programs: tables, NWB, HTML, MJCF.

    \b
    csv      one table for all signals of the same dimensions, units in the
             header; about.json describes the run
    mat      one MATLAB file: a variable for each signal; structs with units,
             labels and configuration
    parquet  the tables of csv, units in the metadata
    nwb      Neurodata Without Borders: potentials as intracellular series,
             with behaviour and positions
    wcon     JSON of worm trackers: the centre line over time, seen from above
    html     one page that needs no other file: numbers, figures,
             configuration, what to cite
    mjcf     the model for plain MuJoCo, with the last state as a keyframe;
             of a preset with servos the keyframe is rest: load it before the
             first step, so that the cables start at their full length

    parquet and nwb need pip install "annelid[export]". annelid draw makes videos. annelid export-network writes a
    network or a whole controller.

    \b
    annelid export runs/walk --to csv
    annelid export runs/walk --to csv --signals ring_length -o rings.csv
    annelid export runs/walk --to mat --every 10 --from-time 2 --to-time 4
    annelid export runs/walk --to html -o report.html
    annelid export riddle2025 --arena pipe.s --to mjcf -o worm_in_pipe.xml
    """
    from annelid.draw.gallery import task_bar
    from annelid.export import FORMATS, Selection, selected
    from annelid.output import with_suffix, write_text
    from annelid.simulation.lock import LOCK_NAME
    from annelid.simulation.runfile import open_run

    if to in ("gif", "mp4") and to not in FORMATS:
        raise RunFileError(f"unknown format '{to}': a video is drawn by annelid draw RUN --video FILE.{to}")
    kind = FORMATS.find(to)
    given = {"--signals": signals, "--every": every, "--from-time": from_time, "--to-time": to_time}
    for option, value in given.items():
        if value is not None and option not in kind.options:
            valid = f"takes {', '.join(sorted(kind.options))}" if kind.options else "takes the whole run"
            raise RunFileError(f"{option} has no effect on {kind.name}, which {valid}")
    kind.require()
    if names_worm(source):
        if kind.worm is None:
            raise RunFileError(f"{kind.name} is written of a run, not of a worm: annelid run {source} makes one")
        target = (
            Path(kind.default)
            if output is None
            else with_suffix(output, (kind.suffix,), kind.name, default=kind.suffix)
        )
        refuse_existing(target, force)
        worm = config_of(source, overrides_of(assignments), segments, fidelity, arena)
        print_paths([write_text(target, kind.worm(worm))])
        return
    if (assignments, segments, fidelity, arena) != (None, None, None, None):
        raise typer.BadParameter("a run is as it was: --set, --segments, --fidelity and --arena change a worm")
    opened = open_run(source)
    target = kind.target(opened, output)
    if output is not None:
        if kind.many and target.suffix.lower() != kind.suffix:
            lock(target)
        # A folder of tables may be there already, but not with something in it.
        if not kind.many or target.is_file():
            refuse_existing(target, force)
        elif not force and target.is_dir() and any(entry.name != LOCK_NAME for entry in target.iterdir()):
            raise RunFileError(f"the folder {target} is not empty: name another with -o, or write into it with --force")
    names = None if signals is None else [name.strip() for name in signals.split(",") if name.strip()]
    part = selected(opened, Selection(names, every or 1, from_time, to_time))
    with task_bar(f"exporting to {kind.name}", quiet=quiet) as progress:
        written = kind.write(part, target, progress or (lambda done, total: None))
    print_paths(written)


@command("cite", "Exchange", as_json=False)
def cite_command(
    source: Annotated[
        str | None,
        typer.Argument(
            metavar="[RUN|PRESET|FILE.toml]",
            help="What you used  [default: only annelid and the paper that it reproduces]",
            autocompletion=worms_from,
        ),
    ] = None,
    everything: Annotated[bool, typer.Option("--all", help="Print every entry that annelid knows.")] = False,
) -> None:
    """Print the references of a run or a preset as BibTeX.

    A comment above each entry says what it is cited for. Fields that annelid does not know for certain are left out.
    The entry's note says which to complete.

    \b
    annelid cite
    annelid cite runs/riddle2023-rods-001 > references.bib
    annelid cite wang
    annelid cite --all
    """
    from annelid.references import bibtex, entries, references_of

    if everything and source is not None:
        raise typer.BadParameter("--all prints every entry: name no run or preset with it")
    if source is None:
        typer.echo(bibtex(entries().keys() if everything else references_of()), nl=False)
        return
    from annelid.config import load_config, preset_names
    from annelid.simulation.runfile import read_config

    if names_worm(source):
        config = load_config(source)
    elif Path(source).exists():
        config = read_config(source)
    else:
        raise ConfigError(f"{source!r} is neither a run nor a preset: {suggest(source, preset_names())}")
    typer.echo(bibtex(references_of(config)), nl=False)
