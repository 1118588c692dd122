"""From a configuration to the plant and the controller that it describes."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

from numpy.typing import ArrayLike

from annelid.config import (
    Boxerbaum2012Body,
    Daltorio2013Body,
    HeteroclinicChannel,
    PhaseChain,
    PlanarBody,
    PressureSns,
    Program,
    RobustSns,
    RunConfig,
    SineWave,
    SnsController,
    TimedWave,
)
from annelid.protocols import Controller, Plant, Sensation


def build_plant(config: RunConfig) -> Plant:
    """Builds the worm's body; a planar one without importing the 3D engine.

    Raises:
        ConfigError: The body cannot be built with these values.
    """
    if isinstance(config.body, PlanarBody):
        from annelid.planar.riddle2022 import Riddle2022Plant

        return Riddle2022Plant(config.body, config.clock)
    if isinstance(config.body, Daltorio2013Body):
        from annelid.planar.daltorio2013 import Daltorio2013Plant

        return Daltorio2013Plant(config.body, config.clock)
    if isinstance(config.body, Boxerbaum2012Body):
        from annelid.planar.boxerbaum2012 import Boxerbaum2012Plant

        return Boxerbaum2012Plant(config.body, config.clock)
    from annelid.simulation.worm import WormPlant

    return WormPlant(config)


def build_controller(config: RunConfig, plant: Plant) -> Controller:
    """Builds the controller for a plant, which gives the numbers of segments and muscles.

    Raises:
        ConfigError: The controller cannot be built with these values.
    """
    pattern = _build_pattern(config, plant)
    if config.turning is None:
        return pattern
    from annelid.control.turning import TurningController

    return TurningController(
        pattern, config.turning, plant.n_segments, plant.n_muscles, config.clock.control_timestep_s
    )


def _build_pattern(config: RunConfig, plant: Plant) -> Controller:
    """Builds the controller of the peristaltic pattern, without turning."""
    section, size = config.controller, (plant.n_segments, plant.n_muscles)
    timestep_s = config.clock.control_timestep_s
    if isinstance(section, SnsController):
        from annelid.control.sns import SnsController as Controlled

        return Controlled(section, config.sensor, *size, timestep_s)
    if isinstance(section, RobustSns):
        from annelid.control.robust import RobustController

        return RobustController(section, *size, timestep_s)
    if isinstance(section, PressureSns):
        from annelid.control.pressure import PressureController

        return PressureController(section, config.sensor, *size, timestep_s)
    if isinstance(section, Program):
        from annelid.control.program import ProgramController

        return ProgramController(section, *size)
    if isinstance(section, SineWave | TimedWave):
        from annelid.control.waves import SineController, TimedController

        return SineController(section, *size) if isinstance(section, SineWave) else TimedController(section, *size)
    from annelid.control import AdaptiveController, oscillators

    if isinstance(section, HeteroclinicChannel):
        return oscillators.HeteroclinicController(section, *size, timestep_s)
    if isinstance(section, PhaseChain):
        return oscillators.PhaseChainController(section, *size, timestep_s)
    return AdaptiveController(section, config.sensor, *size, timestep_s)


def as_controller(
    controller: Controller | Callable[[Sensation], ArrayLike] | None, config: RunConfig, plant: Plant
) -> Controller:
    """Takes a controller as it is, wraps a plain function, or builds the configured controller for None."""
    if controller is None:
        return build_controller(config, plant)
    if hasattr(controller, "step"):
        return cast(Controller, controller)
    from annelid.control.callable import CallableController

    return CallableController(cast(Callable[[Sensation], ArrayLike], controller), plant.n_muscles)
