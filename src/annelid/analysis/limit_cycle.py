"""Limit cycles of a worm under its nervous system: its closed loop as a flow, and the orbit found in it.

`annelid.analysis.events` locates switches within steps, `poincare` the returns to a section; `shooting` closes the
orbit, `floquet` linearises round it, and `phase_response` tells what a perturbation does to its phase.
"""

from __future__ import annotations

from typing import Literal, cast, get_args

import numpy as np

from annelid.analysis.events import travel
from annelid.analysis.flow import ClosedLoop, Continuous, Flow, Switches
from annelid.analysis.orbit import LimitCycle, NoLimitCycle, Section
from annelid.analysis.phase_response import kicked_phase_response
from annelid.analysis.poincare import crossing_times, section_at
from annelid.analysis.shooting import find_limit_cycle
from annelid.clock import StepRatio
from annelid.config import RunConfig, SnsController, load_config
from annelid.errors import ConfigError, suggest
from annelid.protocols import Array, Controller, Plant, Stateful
from annelid.simulation import build_controller, build_plant

__all__ = [
    "LimitCycle",
    "NoLimitCycle",
    "Section",
    "Time",
    "crossing_times",
    "find_limit_cycle",
    "flow_of",
    "kicked_phase_response",
    "limit_cycle",
    "section_at",
    "settled",
    "travel",
]

Time = Literal["continuous", "located", "stepped"]
"""How a worm's time is taken; see `limit_cycle`."""

# Step whose change tells the vector field, and the step that the field is integrated with, s.
_FIELD_STEP_S = 1e-5
_CONTINUOUS_STEP_S = 1e-3


def limit_cycle(
    config: RunConfig,
    *,
    time: Time = "continuous",
    neuron: str = "contraction_1",
    threshold_mV: float | None = None,
    settle_s: float = 5.0,
    n_phases: int = 100,
) -> LimitCycle:
    """Finds the limit cycle of a configured worm under its nervous system.

    Args:
        config: A configuration with a planar body and the synthetic nervous system, without sensor noise.
        time: ``"stepped"``: the worm as it runs, its sensors switching at whole steps only; ``"located"``: the same
            steps, but shortened where a sensor switches; ``"continuous"``: the differential equation that the steps
            approximate, integrated by a method of third order that also locates the kinks of the synapses. The
            linearisation is faithful in the last only.
        neuron: The cycle begins when this neuron's potential rises through the threshold.
        threshold_mV: Relative to rest; default: half of the operating range R.
        settle_s: Simulated time before the search begins, s, longer than ``sensor.startup_hold_s``.
        n_phases: Arcs that the orbit is cut into.

    Returns:
        The limit cycle.

    Raises:
        ConfigError: A controller without neurons, no such neuron, sensor noise, a loop that depends on time itself
            or has too many states (`ClosedLoop`).
        NoLimitCycle: The worm does not oscillate, or not periodically.
    """
    if not isinstance(config.controller, SnsController):
        raise ConfigError(f"controller.kind = {config.controller.kind!r} has no neurons whose rise could begin a cycle")
    flow, state, switches = flow_of(config, time, settle_s)
    section = section_at(flow, neuron, 0.5 * config.controller.range_mV if threshold_mV is None else threshold_mV)
    # The field's rounding, divided by its short step, leaves no more digits.
    tolerance = 1e-7 if time == "continuous" else 1e-9
    return find_limit_cycle(
        flow, state, switches, section, n_phases=n_phases, tolerance=tolerance, refine=time != "stepped"
    )


def flow_of(config: RunConfig, time: Time = "continuous", settle_s: float = 5.0) -> tuple[Flow, Array, Switches]:
    """Builds the closed loop of a configuration and lets it run until what only its beginning sees is over.

    Args:
        config: A configuration without sensor noise; a continuous flow needs a planar body and a controller that
            is the same at every time step.
        time: How its time is taken, as for `limit_cycle`.
        settle_s: Simulated time, s, longer than ``sensor.startup_hold_s``.

    Returns:
        The flow, its states ``(1, n_states)`` and its switches ``(1, n_switches)``.

    Raises:
        ConfigError: Another way of taking time, or as for `limit_cycle`.
    """
    if time not in get_args(Time):
        raise ConfigError(f"unknown time {time!r}: {suggest(time, get_args(Time))}")
    if config.sensor.noise_m > 0.0:
        raise ConfigError(f"sensor.noise_m = {config.sensor.noise_m:g} m leaves no limit cycle: set sensor.noise_m=0")
    if not settle_s > config.sensor.startup_hold_s:
        raise ConfigError(
            f"settle_s = {settle_s:g} must be longer than sensor.startup_hold_s = {config.sensor.startup_hold_s:g}"
        )
    clock = config.clock
    stride = StepRatio(clock.control_timestep_s, clock.physics_timestep_s).control_steps_per_move
    plant = build_plant(config)
    controller = build_controller(config, plant)
    flow, state, switches = settled(plant, controller, clock.control_timestep_s, settle_s, stride=stride)
    if time != "continuous":
        return flow, state, switches
    loop = _infinitesimal(config, plant, controller)
    return Continuous(loop, _CONTINUOUS_STEP_S), *loop.present()


def settled(
    plant: Plant, controller: Controller, control_timestep_s: float, settle_s: float, *, stride: int = 1
) -> tuple[ClosedLoop, Array, Switches]:
    """Lets any plant and controller run from their reset, and makes the closed loop of them.

    Args:
        plant: The body.
        controller: The controller.
        control_timestep_s: Duration of a control step, s.
        settle_s: Simulated time, s.
        stride: Control steps from one movement of the body to the next.

    Returns:
        The loop, its states ``(1, n_states)`` and its switches ``(1, n_switches)``.

    Raises:
        ConfigError: The loop depends on time itself, or cannot be linearised (`ClosedLoop`).
    """
    sensation = plant.reset(0)
    controller.reset(0)
    earlier = ClosedLoop(plant, controller, control_timestep_s, stride)
    n_steps = stride * max(2, round(settle_s / control_timestep_s / stride))
    middle = n_steps // stride // 2 * stride
    for step in range(n_steps):
        if step == middle:
            earlier = ClosedLoop(plant, controller, control_timestep_s, stride)
        sensation = plant.step(controller.step(sensation))
    loop = ClosedLoop(plant, controller, control_timestep_s, stride)
    state, switches = loop.present()
    if not all(map(np.array_equal, loop.step(state, switches), earlier.step(state, switches))):
        raise ConfigError(
            f"{type(plant).__name__} under {type(controller).__name__} depends on time itself, not on its state alone: "
            "only an autonomous loop has a limit cycle of its own"
        )
    return loop, state, switches


def _infinitesimal(config: RunConfig, plant: Plant, controller: Controller) -> ClosedLoop:
    """The same loop in forward Euler steps so short that they tell the vector field."""
    tree = config.model_dump()
    tree["clock"] = {"control_timestep_s": _FIELD_STEP_S, "physics_timestep_s": _FIELD_STEP_S}
    if isinstance(config.controller, SnsController):
        tree["controller"]["scheme"] = "euler"
    # Time runs slower there, and must not come back into the hold.
    tree["sensor"]["startup_hold_s"] = 0.0
    tree["record"] = {"signals_interval_s": config.duration_s, "frames_interval_s": config.duration_s}
    short = load_config(tree)
    body = build_plant(short)
    nerves = build_controller(short, body)
    for new, old in ((body, plant), (nerves, controller)):
        cast(Stateful, new).set_state(cast(Stateful, old).get_state())
    return ClosedLoop(body, nerves, _FIELD_STEP_S, kinks=True)
