"""The commands on a finished run: `show`, `plot` and `render`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.common import Force, RunPath, print_table, refuse_existing


def show(
    run: RunPath,
    as_json: Annotated[bool, typer.Option("--json", help="Print the numbers as JSON, in SI units.")] = False,
    verify: Annotated[
        bool, typer.Option("--verify", help="Only tell whether every byte of the file is as it was when the run ended.")
    ] = False,
) -> None:
    """Print the numbers of a run.

    Beside them stand the published ones, where there are any.

    A run that has ended carries a digest of every variable. Files up to 64 MB are compared with theirs whenever they
    are opened, larger ones with --verify only, which names the variables that are damaged.

    \b
    annelid show runs/riddle2023-001
    annelid show runs/riddle2023-001 --json | jq .period_s
    annelid show runs/riddle2023-001 --verify
    """
    from annelid.analysis import gait, summary
    from annelid.simulation.runfile import open_run, verify_run

    if verify:
        if as_json:
            raise typer.BadParameter("--verify prints one sentence: it does not go with --json")
        typer.echo(verify_run(run))
        return
    opened = open_run(run)
    if as_json:
        numbers = summary(opened).to_dict() | {"gait": gait(opened).to_dict()}
        typer.echo(json.dumps(numbers, indent=2, allow_nan=False))
        return
    print_table(opened)
    if opened.message:
        typer.echo(opened.message)


def plot(
    run: RunPath,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Picture to write: .png, .pdf, .svg  [default: FIGURE.png in the run]"),
    ] = None,
    figure: Annotated[
        str, typer.Option(metavar="FIGURE", help="figure7: potentials and lengths; track: the way, seen from above.")
    ] = "figure7",
    force: Force = False,
) -> None:
    """Draw potentials and lengths over time, or the track.

    The counterpart of the paper's figure 7, or where the worm crawled: the ways of its middle and of its front, its
    outline at several times, and what stood in the way.

    \b
    annelid plot runs/riddle2023-001 -o figure7.pdf
    annelid plot runs/riddle2025-001 --figure track
    """
    from annelid.draw.figures import RUN_FIGURES
    from annelid.draw.plots import plot_path
    from annelid.simulation.runfile import open_run

    draw = RUN_FIGURES.find(figure)
    opened = open_run(run)
    if output is None:
        target = opened.path.parent / f"{figure}.png"
    else:
        target = plot_path(output)
        refuse_existing(target, force)
    typer.echo(draw(opened, target))


def render(
    run: RunPath,
    at: Annotated[float | None, typer.Option("--time", help="Draw one frame at this time, s.")] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Frame to write: .png, .jpg  [default: frame.png in the run]")
    ] = None,
    video: Annotated[Path | None, typer.Option(help="Draw a video: .mp4, .mov, .mkv, .gif")] = None,
    fps: Annotated[float, typer.Option(help="Frames a second of the video, 1 to 240.")] = 25.0,
    speed: Annotated[float, typer.Option(help="Simulated seconds a second of video.")] = 1.0,
    camera: Annotated[
        str | None, typer.Option(help="isometric, side, top, front or course  [default: isometric]")
    ] = None,
    force: Force = False,
) -> None:
    """Draw a frame or a video of a run.

    Both come from the recorded postures: later, and on any machine.

    \b
    annelid render runs/riddle2023-001 --time 1.5 -o frame.png
    annelid render runs/riddle2023-001 --video slow.mp4 --speed 0.25
    annelid render runs/riddle2023-001 --time 1.5 --camera side -o side.png
    """
    from annelid.draw.gallery import VIDEO_TASK, task_bar
    from annelid.draw.render import render_frame, render_video
    from annelid.simulation.runfile import open_run

    if video is None and at is None:
        raise typer.BadParameter("say what to draw: --time SECONDS for a frame, --video FILE for a video")
    if output is not None and at is None:
        raise typer.BadParameter("-o names the frame, so it needs --time SECONDS as well")
    opened = open_run(run)
    for target in (output, video):
        if target is not None:
            refuse_existing(target, force)
    frame = opened.path.parent / "frame.png" if output is None else output
    if at is not None:
        typer.echo(render_frame(opened, at, frame, camera=camera))
    if video is not None:
        with task_bar(VIDEO_TASK) as progress:
            render_video(opened, video, fps=fps, speed=speed, camera=camera, progress=progress)
        typer.echo(video)
