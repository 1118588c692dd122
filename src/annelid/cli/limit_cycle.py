"""The command `limit-cycle`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.common import Assignments, Force, Preset, Segments, config_of, overrides_of, refuse_existing


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

    from annelid.analysis.limit_cycle import Time, limit_cycle
    from annelid.draw.figures.limit_cycle import limit_cycle_figure
    from annelid.draw.plots import plot_path
    from annelid.draw.table import TIMES, cycle_numbers, cycle_table
    from annelid.terminal import Console

    if output is not None:
        output = plot_path(output)
        refuse_existing(output, force)
    config = config_of("riddle2022-planar" if preset is None else preset, overrides_of(assignments), segments)
    ways = cast(list["Time"], times or list(get_args(Time)))
    cycles = {way: limit_cycle(config, time=way, neuron=neuron, threshold_mV=threshold) for way in ways}
    if as_json:
        typer.echo(json.dumps({"name": config.name, "n_segments": config.body.n_segments} | cycle_numbers(cycles)))
    else:
        Console().print(cycle_table(f"{config.name}, {config.body.n_segments} segments", cycles))
    if output is not None:
        named = {TIMES[way]: cycle for way, cycle in cycles.items()}
        typer.echo(limit_cycle_figure(named, output), err=as_json)
