"""The command `calibrate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.common import (
    RIGID_PRESET,
    Assignments,
    Force,
    NamedPreset,
    Quiet,
    config_of,
    overrides_of,
    print_results,
    refuse_existing,
)
from annelid.cli.entry import lock


def calibrate_command(
    preset: NamedPreset = RIGID_PRESET,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results.")] = Path("calibration"),
    assignments: Assignments = None,
    free: Annotated[
        list[str] | None,
        typer.Option(
            "--free", metavar="PARAMETER", help="Fit only these; may be repeated.  [default: the first three]"
        ),
    ] = None,
    data: Annotated[
        Path | None, typer.Option("--data", help="Measured loop to fit.  [default: the one of annelid]")
    ] = None,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Fit the rod worm to a measured load-frame loop.

    Strands of the stiffness-equivalent radius 0.00299 m and 571.6 kg/m^3, unless --set says otherwise. Takes a
    few minutes. Writes calibration.json, calibration.png and .svg, and calibrated.toml: the fields to put into
    a file of your own.

    \b
    --free young_modulus         of the strands; the shear modulus keeps its ratio to it
    --free dry_friction          Coulomb torque of a crossing
    --free cable_friction        of the cable round the ring: coefficient times angle
    --free spring_rate           of the axial springs
    --free spring_rest_length    of the axial springs
    --free viscous_friction      torque of a crossing per angular velocity

    \b
    annelid calibrate
    annelid calibrate --set body.strands.radius_m=0.002
    annelid calibrate --set body.springs.stiffness_N_per_m=24.5 --set body.springs.rest_length_m=0.065
    annelid calibrate --free young_modulus --free dry_friction --data mine.csv
    """
    from annelid.experiment.calibration import DEFAULT_FREE, EQUAL_STIFFNESS, calibrate, fit_tables, write_calibration
    from annelid.experiment.load_frame import draw_loops, read_loop
    from annelid.experiment.progress import study_progress

    report = output / "calibration.json"
    lock(output)
    refuse_existing(report, force)
    measured = read_loop(data)
    changes = EQUAL_STIFFNESS | overrides_of(assignments)
    config = config_of(preset, dict(changes))
    with study_progress(quiet=quiet) as progress:
        fit = calibrate(
            config,
            measured,
            free=free or DEFAULT_FREE,
            progress=None
            if progress is None
            else lambda loops, rms: progress(f"calibrating, {rms:.2f} N off after {loops} loops", 0, 0, 0.0),
        )
    picture = draw_loops({"fitted": fit.simulated, "measured": measured}, report.with_suffix(""))
    print_results((*write_calibration(fit, preset, changes, report), picture), *fit_tables(fit), quiet=quiet)
