"""The command `view`."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from annelid.cli.common import (
    RIGID_PRESET,
    ArenaName,
    Assignments,
    FidelityLevel,
    Force,
    Segments,
    config_of,
    overrides_of,
    refuse_existing,
)
from annelid.cli.entry import complain

if TYPE_CHECKING:
    from annelid.config import RunConfig
    from annelid.simulation.runfile import Run


def view_command(
    source: Annotated[
        str | None,
        typer.Argument(metavar="[PRESET|FILE.toml|RUN]", help="A worm to run, or a run's folder or run.nc to play."),
    ] = None,
    assignments: Assignments = None,
    segments: Segments = None,
    fidelity: FidelityLevel = None,
    arena: ArenaName = None,
    speed: Annotated[float, typer.Option(min=0.05, max=10.0, help="Simulated seconds a second at the start.")] = 1.0,
    export: Annotated[
        Path | None,
        typer.Option(metavar="FILE.html", help="Write one HTML page that opens from disk and plays, and show nothing."),
    ] = None,
    native: Annotated[
        bool, typer.Option("--native", help="In MuJoCo's own window instead of a browser; needs a display.")
    ] = False,
    open_browser: Annotated[bool, typer.Option("--open/--no-open", help="Open the page in the browser.")] = True,
    host: Annotated[
        str,
        typer.Option(help="Address to listen on; 0.0.0.0 lets in other machines that know the token."),
    ] = "127.0.0.1",
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Port; 0 for any that is free  [default: the first from 8080]")
    ] = None,
    force: Force = False,
) -> None:
    """Watch a worm in the browser while it runs, turn its knobs and poke it; or play a run.

    Shows the mesh, ring muscles coloured by activation, springs by strain, the forces of the ground, and the neurons
    of the last five seconds. Sliders change friction, stiffness, sensors and drive of the running worm; a click
    pokes it. A recorded run is played the same way. Needs viser: pip install "annelid[view]". Nothing is loaded from
    the network, and the page is for this machine only unless --host says otherwise. Ctrl-C ends it.

    \b
    annelid view                                         riddle2023-rods, live
    annelid view riddle2025-adaptive --arena pipe.taper  another one, elsewhere
    annelid view --set arena.friction=0.3 --speed 0.5    changed, in slow motion
    annelid view runs/riddle2023-rods-001                a run, as it was recorded
    annelid view runs/riddle2023-rods-001 --export walk.html   as one page to send by mail
    annelid view --native                                in MuJoCo's own window
    """
    worm = _worm_or_run(source, assignments, segments, fidelity, arena)
    if export is not None:
        if native:
            raise typer.BadParameter("--export writes a page: it does not go with --native")
        _export(worm, export, speed, force)
        return
    if native:
        from annelid.live.native import show_native

        show_native(worm, speed=speed)
        return
    from annelid.live.server import free_port, warning_of
    from annelid.live.show import Show

    if (warning := warning_of(host)) is not None:
        complain(f"warning: {warning}")
    with Show(worm, host=host, port=free_port(host, port), speed=speed) as show:
        typer.echo(f"{show.address}  (Ctrl-C ends)")
        if open_browser:
            webbrowser.open(show.address)
        try:
            show.run()
        except KeyboardInterrupt:
            typer.echo("")


def _worm_or_run(
    source: str | None,
    assignments: list[str] | None,
    segments: int | None,
    fidelity: str | None,
    arena: str | None,
) -> RunConfig | Run:
    """Returns the run that a path holds, or the configuration that the rest describes."""
    path = Path(source) if source else None
    if path is not None and path.suffix != ".toml" and path.exists():
        from annelid.simulation.runfile import open_run

        if (assignments, segments, fidelity, arena) != (None, None, None, None):
            raise typer.BadParameter("a run is played as it was: give no --set, --segments, --fidelity or --arena")
        return open_run(path)
    return config_of(RIGID_PRESET if source is None else source, overrides_of(assignments), segments, fidelity, arena)


def _export(worm: RunConfig | Run, path: Path, speed: float, force: bool) -> None:
    from annelid.draw.gallery import task_bar
    from annelid.live.page import export_page, page_path

    path = page_path(path)
    refuse_existing(path, force, "--export")
    with task_bar("writing the page") as progress:
        typer.echo(export_page(worm, path, speed=speed, progress=progress))
