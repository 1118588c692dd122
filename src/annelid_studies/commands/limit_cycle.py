"""The study `limit-cycle`: how stable the rhythm of a planar worm is."""

from __future__ import annotations

from typing import Annotated

import typer

from annelid.cli import (
    Assignments,
    Preset,
    Segments,
    config_of,
    give,
    overrides_of,
    study,
)


@study("limit-cycle")
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
) -> None:
    """Find a planar worm's limit cycle, and how stable it is.

    It follows the worm until its states repeat, and then disturbs each state a little at a hundred points of the cycle.
    It prints the period and the Floquet multipliers. A multiplier is the part of a deviation that remains after one
    cycle. The rhythm is stable if all but one are below 1 in magnitude; the one at 1 is a shift in time, which stays.

    Time is continuous: the equations are integrated between the switches of sensors and synapses. --json adds the phase
    response: how far a kick of a neuron, at each phase, advances the rhythm. It takes about ten seconds for 3 segments,
    twenty for 6. The body is riddle2022 and the controller sns.

    \b
    annelid study limit-cycle riddle2022-planar --segments 6
    annelid study limit-cycle --set controller.gate_time_constant_ms=200
    annelid study limit-cycle --json | jq .multipliers[0]
    """
    from annelid.terminal import Console
    from annelid_studies.limit_cycle.cycle import limit_cycle
    from annelid_studies.limit_cycle.report import cycle_numbers, cycle_table

    config = config_of("riddle2022-planar" if preset is None else preset, overrides_of(assignments), segments)
    cycle = limit_cycle(config, neuron=neuron, threshold_mV=threshold)
    if not give({"name": config.name, "n_segments": config.body.n_segments} | cycle_numbers(cycle)):
        Console().print(cycle_table(f"{config.name}, {config.body.n_segments} segments", cycle))
