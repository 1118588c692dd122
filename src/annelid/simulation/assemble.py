"""From a configuration to the plant and the controller that it describes."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

from numpy.typing import ArrayLike

from annelid.config import RunConfig
from annelid.protocols import Controller, Plant, Sensation


def build_plant(config: RunConfig) -> Plant:
    """Builds the worm's body; a planar one without importing the 3D engine.

    Raises:
        ConfigError: The body cannot be built with these values.
    """
    return config.body.build(config)


def build_controller(config: RunConfig, plant: Plant) -> Controller:
    """Builds the controller for a plant, which gives the numbers of segments and muscles.

    Raises:
        ConfigError: The controller cannot be built with these values.
    """
    pattern = config.controller.build(config, plant)
    if config.turning is None:
        return pattern
    from annelid.control.turning import TurningController

    return TurningController(
        pattern, config.turning, plant.n_segments, plant.n_muscles, config.clock.control_timestep_s
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
