"""From a configuration to the plant and the controller that it describes."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

from numpy.typing import ArrayLike

from annelid.config import PlanarBody, Program, RunConfig
from annelid.protocols import Controller, Plant, Sensation


def build_plant(config: RunConfig) -> Plant:
    """Builds the worm's body; a planar one without importing the 3D engine.

    Raises:
        ConfigError: The body cannot be built with these values.
    """
    if isinstance(config.body, PlanarBody):
        from annelid.planar.riddle2022 import Riddle2022Plant

        return Riddle2022Plant(config.body, config.clock)
    from annelid.simulation.worm import WormPlant

    return WormPlant(config)


def build_controller(config: RunConfig, plant: Plant) -> Controller:
    """Builds the controller for a plant, which gives the numbers of segments and muscles.

    Raises:
        ConfigError: The controller cannot be built with these values.
    """
    if isinstance(config.controller, Program):
        from annelid.control.program import ProgramController

        return ProgramController(config.controller, plant.n_segments, plant.n_muscles)
    from annelid.control.sns import SnsController

    return SnsController(
        config.controller,
        config.sensor,
        plant.n_segments,
        plant.n_muscles,
        config.clock.control_timestep_s,
    )


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
