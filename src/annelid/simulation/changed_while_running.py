"""Another configuration for a worm that is running: it goes on from where it is, under other numbers."""

from __future__ import annotations

from typing import TypeVar

from annelid.arena.friction import set_friction
from annelid.config import RunConfig
from annelid.errors import ConfigError
from annelid.protocols import State, Stateful
from annelid.simulation.stepping import Simulation, build_controller, build_plant
from annelid.simulation.worm import WormPlant

Part = TypeVar("Part")


def adjusted(running: Simulation, before: RunConfig, after: RunConfig) -> Simulation:
    """Returns a simulation under another configuration, in the state of a running one that is not to be used any more.

    Friction is changed in the compiled model, which takes microseconds. For anything else in the body, its ground or
    the clock the body is built anew and takes over the old one's state; so does the controller. In both cases the worm
    moves on as one does that was built with the new values and brought into this state.

    Raises:
        ConfigError: The new body or controller cannot be built, or has other states than the running one.
    """
    plant, controller = running.plant, running.controller

    def differ(*parts: str) -> bool:
        return any(getattr(before, part) != getattr(after, part) for part in parts)

    if differ("body", "arena", "clock", "trial"):
        if isinstance(plant, WormPlant) and _differ_in_friction_only(before, after):
            assert after.arena is not None
            set_friction(plant.model, after.arena.friction)
        else:
            plant = _taking_over(build_plant(after), plant, "body")
            if differ("clock") and isinstance(plant, WormPlant):
                # Its state of one step ago is that of a step of another length.
                plant.mechanics.rest()
    if differ("controller", "turning", "sensor", "clock", "trial"):
        controller = _taking_over(build_controller(after, plant), controller, "controller")
    simulation = Simulation(after, plant, controller, running.sensation, running.noise, running.step)
    simulation.activation = running.activation
    return simulation


def _differ_in_friction_only(before: RunConfig, after: RunConfig) -> bool:
    if before.arena is None or after.arena is None or before.arena.has_setae or after.arena.has_setae:
        return False
    # Parts of a scene have a friction of their own.
    if after.arena.is_scene:
        return False
    alike = before.arena.model_copy(update={"friction": after.arena.friction})
    return (before.body, alike, before.clock, before.trial) == (after.body, after.arena, after.clock, after.trial)


def _taking_over(new: Part, old: Part, what: str) -> Part:
    """Gives a new plant or controller the state of the one that it replaces."""
    if not (isinstance(new, Stateful) and isinstance(old, Stateful)):
        raise ConfigError(f"the {what} cannot be saved, so it cannot be changed while it runs")
    state = old.get_state()
    if _shapes(state) != _shapes(new.get_state()):
        raise ConfigError(f"the new {what} has other states than the one that runs: start it anew")
    new.set_state(state)
    return new


def _shapes(state: State) -> dict[str, tuple[int, ...]]:
    return {name: values.shape for name, values in state.items()}
