"""Plant, controller and sensor noise: built from a configuration, and advanced together by control steps."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from annelid.clock import StepRatio
from annelid.config import RunConfig
from annelid.control.base import CallableController
from annelid.errors import RunFileError, SimulationStopped
from annelid.protocols import (
    Array,
    Controller,
    Doubtful,
    MultiRatePlant,
    Plant,
    Sensation,
    Stateful,
    StridingController,
    Watched,
)
from annelid.simulation.checkpoint import Checkpoint, generator_state, restore_generator
from annelid.simulation.recorder import Schedule
from annelid.simulation.resume import Origin

_ACTIVATION_SLACK = 1e-9
_OPTIONAL_FIELDS = ("ring_length_m", "muscle_force_N", "contact_force_N", "center_of_mass_m")


def build_plant(config: RunConfig) -> Plant:
    """Builds the worm's body; a planar one without importing the 3D engine.

    Args:
        config: The run's configuration.

    Returns:
        The body at rest.

    Raises:
        ConfigError: The body cannot be built with these values.
    """
    return config.body.build(config)


def build_controller(config: RunConfig, plant: Plant) -> Controller:
    """Builds the controller of a configuration, with its turning and what goes wrong on its way to the body.

    Args:
        config: The run's configuration.
        plant: The body that it drives, which gives the numbers of segments and muscles.

    Returns:
        The controller in its initial state.

    Raises:
        ConfigError: The controller cannot be built with these values.
    """
    known, body = (config, plant) if config.trial is None else config.trial.known(config, plant)
    controller = known.controller.build(known, body)
    if known.turning is not None:
        from annelid.control.turning import TurningController

        step_s = known.clock.control_timestep_s
        controller = TurningController(controller, known.turning, plant.n_segments, plant.n_muscles, step_s)
    return controller if config.trial is None else config.trial.between(controller, config, plant)


def as_controller(
    controller: Controller | Callable[[Sensation], ArrayLike] | None, config: RunConfig, plant: Plant
) -> Controller:
    """Takes a controller as it is, wraps a plain function, or builds the configured controller for None."""
    if controller is None:
        return build_controller(config, plant)
    if hasattr(controller, "step"):
        own = cast(Controller, controller)
    else:
        own = CallableController(cast(Callable[[Sensation], ArrayLike], controller), plant.n_muscles)
    return own if config.trial is None else config.trial.between(own, config, plant)


class Simulation:
    """Plant, controller and sensor noise between two control steps.

    Attributes:
        plant: The body.
        controller: The controller.
        schedule: When it ends and is recorded.
        step: Control steps taken since time zero.
        sensation: The plant's latest sensation, without noise.
        activation: The latest activation.
        noise: Generator of the sensor noise.
    """

    def __init__(
        self,
        config: RunConfig,
        plant: Plant,
        controller: Controller,
        sensation: Sensation,
        noise: np.random.Generator,
        step: int = 0,
    ) -> None:
        self.plant, self.controller = plant, controller
        self.schedule = Schedule.of(config, step)
        self.step, self.sensation = step, sensation
        self.activation: Array = np.zeros(plant.n_muscles)
        self.noise, self._noise_m = noise, config.sensor.noise_m
        # A quantity that a body does not have is NaN from the start and means nothing later.
        has = [name for name in _OPTIONAL_FIELDS if np.isfinite(getattr(sensation, name)).all()]
        self._watched = ["stretch_m", *has]
        # Nothing new can run away between two steps of a slower body.
        ratio = StepRatio(config.clock.control_timestep_s, config.clock.physics_timestep_s)
        self._watch_every = ratio.control_steps_per_move
        self._striders = None
        # Noise is drawn at every control step.
        if not self._noise_m and isinstance(plant, MultiRatePlant) and isinstance(controller, StridingController):
            self._striders = plant, controller
        self._alarms = [part.alarm for part in (plant, controller) if isinstance(part, Watched)]

    def advance(self) -> None:
        """Takes one control step, or all up to the next movement, sample or frame where plant and controller can.

        Raises:
            SimulationStopped: The activation is out of range, the body has moved and its numbers have run away, or
                plant or controller is alarmed.
        """
        if self._striders is None:
            n_steps = 1
            activation = np.asarray(self.controller.step(self.observed()), dtype=np.float64)[np.newaxis]
            self._check(activation)
            self.sensation = self.plant.step(activation[0])
        else:
            plant, controller = self._striders
            n_steps = min(plant.steps_to_move(), self.schedule.steps_to_record(self.step))
            activation = np.asarray(controller.stride(self.sensation, n_steps), dtype=np.float64)
            self._check(activation)
            self.sensation = plant.stride(activation)
        self.activation = activation[-1]
        self.step += n_steps
        if self.step % self._watch_every < n_steps:
            self._watch()

    def _watch(self) -> None:
        """Stops a body whose numbers have run away, or an alarmed plant or controller."""
        total = 0.0
        for name in self._watched:
            total += np.add.reduce(getattr(self.sensation, name), axis=None)
        if not math.isfinite(total):
            self._explain_runaway()
        for alarm in self._alarms:
            reason = alarm()
            if reason:
                raise SimulationStopped(self.at(reason))

    def doubts(self) -> tuple[str, ...]:
        """Returns what plant and controller find doubtful, a sentence each."""
        parts = (self.plant, self.controller)
        return tuple(doubt for part in parts if isinstance(part, Doubtful) for doubt in part.doubts())

    def observed(self) -> Sensation:
        """Returns what the controller observes: the sensation with noise on the stretch sensors."""
        true = self.sensation
        if not self._noise_m:
            return true
        noise = self.noise.normal(0.0, self._noise_m, true.stretch_m.shape)
        return replace(true, stretch_m=true.stretch_m + noise)

    def _check(self, activation: Array) -> None:
        """Stops a controller that breaks its promise before its numbers reach the engine.

        Given is the activation of some steps, ``(n_steps, n_muscles)``.
        """
        if activation.shape[1:] != self.activation.shape:
            shape = activation.shape[1:]
            raise SimulationStopped(
                self.at(f"the controller gave activation of shape {shape}, not {self.activation.shape}")
            )
        # Written so that NaN fails it.
        good = (activation >= -_ACTIVATION_SLACK) & (activation <= 1 + _ACTIVATION_SLACK)
        if not good.all():
            step, muscle = np.argwhere(~good)[0].tolist()
            value = activation[step, muscle]
            raise SimulationStopped(
                self.at(f"the controller gave muscle {muscle + 1} an activation of {value:g}, not in 0 .. 1")
            )

    def checkpoint(self) -> Checkpoint | None:
        """Returns all that the next step depends on, or None if plant or controller cannot be saved."""
        plant, controller = self.plant, self.controller
        if not (isinstance(plant, Stateful) and isinstance(controller, Stateful)):
            return None
        noise = generator_state(self.noise)
        return Checkpoint(self.step, self.sensation, noise, plant.get_state(), controller.get_state())

    def _explain_runaway(self) -> None:
        for name in self._watched:
            values = getattr(self.sensation, name)
            if not np.isfinite(values).all():
                where = np.argwhere(~np.isfinite(values))[0]
                raise SimulationStopped(
                    self.at(f"{name}{[int(i) + 1 for i in where]} became {values[tuple(where)]}, not a finite number")
                )

    def at(self, reason: str) -> str:
        """Returns a sentence that begins with the simulated time."""
        return f"at {self.step * self.schedule.timestep_s:.6g} s of simulated time: {reason}"


def start(config: RunConfig, plant: Plant, controller: Controller, origin: Origin | None) -> Simulation:
    """Resets plant and controller, each with a seed of its own, or takes up the checkpoint of a run to continue.

    Args:
        config: The configuration.
        plant: The body.
        controller: The controller.
        origin: The run to continue, or None.

    Raises:
        RunFileError: There is a run to continue, but plant or controller cannot be restored, or not to its state.
    """
    noise, plant_seed, controller_seed = np.random.SeedSequence(config.seed).spawn(3)
    sensation = plant.reset(int(plant_seed.generate_state(1)[0]))
    controller.reset(int(controller_seed.generate_state(1)[0]))
    beginning = Simulation(config, plant, controller, sensation, np.random.Generator(np.random.PCG64(noise)))
    if origin is None:
        return beginning
    fresh, saved = beginning.checkpoint(), origin.checkpoint
    if not (isinstance(plant, Stateful) and isinstance(controller, Stateful)) or fresh is None:
        raise RunFileError(f"{origin.path} cannot be continued with a plant or controller that cannot be restored")
    before = Schedule.of(origin.config)
    try:
        misfit = saved.misfit(fresh, before.timestep_s, before.end)
        if misfit is None:
            generator = restore_generator(saved.noise)
            plant.set_state(saved.plant)
            controller.set_state(saved.controller)
            return Simulation(config, plant, controller, saved.sensation, generator, saved.step)
    # What a plant or a controller says to a state that none of its own runs has come to.
    except Exception as error:
        misfit = str(error) or type(error).__name__
    raise RunFileError(f"{origin.path} cannot be continued: {' '.join(misfit.split())}")
