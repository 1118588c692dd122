"""The commands `check` and `doctor`: whether a worm's numbers fit, and whether everything is installed."""

from __future__ import annotations

from dataclasses import asdict

import typer

from annelid.cli.common import ArenaName, Assignments, FidelityLevel, Preset, Segments, config_of, overrides_of
from annelid.cli.entry import EXIT_USAGE, command
from annelid.cli.json_output import give


@command("check", "Make")
def check(
    preset: Preset = None,
    assignments: Assignments = None,
    segments: Segments = None,
    fidelity: FidelityLevel = None,
    arena: ArenaName = None,
) -> None:
    """Check before a run whether the numbers of a 3D worm fit together.

    It compares lengths with the ring at rest, forces with the strength of the mesh, the step with the stiffness, and
    the tolerance of the sensors with the mesh. It also builds worm and controller. A finding says what is wrong and
    what to set instead. A run with an error is refused. A run with a warning is doubtful; its file says so. What only
    the motion shows, such as a slack cable, is in the table of the run. The exit code is 2 if there is an error, else
    0.

    \b
    annelid check riddle2025 --set body.mesh.radius_m=0.05
    annelid check my.toml --json
    """
    from annelid.plausibility import check as findings_of
    from annelid.simulation import build_controller, build_plant

    config = config_of(preset, overrides_of(assignments), segments, fidelity, arena)
    found = findings_of(config)
    if not any(finding.severity == "error" for finding in found):
        build_controller(config, build_plant(config))
    if not give([asdict(finding) for finding in found]):
        typer.echo(
            "\n".join(f"{finding.severity}: {finding}" for finding in found) or "no doubts: the numbers fit together"
        )
    if any(finding.severity == "error" for finding in found):
        raise typer.Exit(EXIT_USAGE)


@command("doctor", "Help")
def doctor() -> None:
    """Say what is missing and how to install it.

    It names no user, no machine and no folder, so that you can paste it into a bug report.

    \b
    annelid doctor
    """
    from annelid.draw.doctor import examine

    found = list(examine())
    if not give([asdict(finding) for finding in found]):
        typer.echo("\n".join(finding.line() for finding in found))
