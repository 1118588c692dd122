"""The command `experiment load-frame`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.common import (
    RIGID_PRESET,
    Assignments,
    FidelityLevel,
    Force,
    NamedPreset,
    Quiet,
    config_of,
    overrides_of,
    print_results,
    refuse_existing,
)
from annelid.cli.entry import lock, study


@study("load-frame")
def load_frame_command(
    preset: NamedPreset = RIGID_PRESET,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results.")] = Path("load-frame"),
    assignments: Assignments = None,
    fidelity: FidelityLevel = None,
    displacement: Annotated[float, typer.Option(help="How far the cable is wound, mm.")] = 330.0,
    speed: Annotated[float, typer.Option(help="Speed of the cable, mm/s.")] = 10.0,
    cable_friction: Annotated[
        float,
        typer.Option(
            min=0.0, max=20.0, help="Friction of the cable: coefficient times the angle it is wrapped round, rad."
        ),
    ] = 0.0,
    data: Annotated[
        Path | None, typer.Option("--data", help="Measured loop to compare with.  [default: the one of annelid]")
    ] = None,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Close one ring by its cable and open it again.

    The middle ring of a weightless worm is wound in slowly and let out; the cable's force is compared with what
    the authors measured on one segment of the robot. A few seconds. Writes load_frame.csv, .png and .svg.

    \b
    annelid experiment load-frame
    annelid experiment load-frame --set body.strands.young_modulus_Pa=1e9 --set body.joints.dry_friction_Nm=0.01
    """
    from annelid.experiment.load_frame import (
        MM,
        cable_force,
        draw_loops,
        frame_table,
        load_frame,
        read_loop,
        write_loop,
    )
    from annelid.experiment.progress import study_progress

    table = output / "load_frame.csv"
    lock(output)
    refuse_existing(table, force)
    measured = read_loop(data)
    config = config_of(preset, overrides_of(assignments), fidelity=fidelity)
    with study_progress(quiet=quiet) as progress:
        tension = load_frame(
            config,
            displacement_m=displacement * MM,
            speed_m_per_s=speed * MM,
            progress=None if progress is None else lambda share: progress("load frame", 0, 0, share),
        )
    loop = cable_force(tension, cable_friction)
    loops = {config.name: loop, "measured": measured}
    written = write_loop(loop, tension, table), draw_loops(loops, table.with_suffix(""))
    print_results(written, frame_table(loops), quiet=quiet)
