"""A worm that runs while it is watched: changed, poked and started anew."""

from __future__ import annotations

from collections.abc import Mapping
from time import perf_counter
from typing import Any

import numpy as np

from annelid.config import BodyKind, Knob, RunConfig, load_config
from annelid.config.kinds import above
from annelid.live.history import History, Moment, signal_names
from annelid.morphology import Array
from annelid.protocols import Plant, Records
from annelid.simulation.changed_while_running import adjusted
from annelid.simulation.stepping import Simulation, build_controller, build_plant, start
from annelid.simulation.worm import WormPlant

ENDLESS_S = 1e7  # a live worm runs until the view ends; its configuration keeps the duration that it has
SAMPLE_S = 0.01  # signals for the plots are kept at most this often, in simulated time
POKE_S = 0.15  # how long a poke lasts, in simulated time
POKE_RADIUS_M = 0.06
"""Distance from the middle of a poke at which its force has fallen to 0.6, as under the flat of a hand."""


class LiveWorm:
    """Body and nervous system from time zero on, and a history of what is remembered of them."""

    def __init__(self, config: RunConfig) -> None:
        self._first = self.config = config
        self.restart()

    @property
    def plant(self) -> WormPlant:
        """The body of a 3D worm."""
        plant = self.simulation.plant
        assert isinstance(plant, WormPlant)
        return plant

    @property
    def time_s(self) -> float:
        """Simulated time, s."""
        return self.simulation.step * self.config.clock.control_timestep_s

    def restart(self) -> None:
        """Begins anew at time zero under the present configuration, and forgets what was."""
        plant = build_plant(self.config)
        controller = build_controller(self.config, plant)
        self.simulation: Simulation = start(_endless(self.config), plant, controller, None)
        self._poke_ends_s = -1.0
        self._next_sample_s = 0.0
        neurons = controller.recordable().coords.get("neuron", ()) if isinstance(controller, Records) else ()
        self.history = History(signal_names(map(str, neurons), plant.n_muscles))
        self._record_signals()
        self._record()

    def reset_fields(self) -> None:
        """Gives all fields the values that the worm came with; it goes on from where it is."""
        self._take(self._first)

    def adjust(self, values: Mapping[str, Any]) -> None:
        """Changes fields of the configuration by dotted path; the worm goes on from where it is.

        Raises:
            ConfigError: A value is out of range, or the body cannot be built with it; nothing has changed then.
        """
        self._take(load_config(self.config.model_dump(), values))

    def turn(self, knob: Knob, shown: float) -> None:
        """Changes a field to what a slider shows, as `adjust`."""
        self.adjust({knob.field: knob.value(shown)})

    def _take(self, config: RunConfig) -> None:
        self.simulation = adjusted(self.simulation, _endless(self.config), _endless(config))
        self.config = config

    def advance(self, until_s: float, deadline: float) -> None:
        """Runs up to a simulated time, or to a moment of `time.perf_counter`, and remembers where it has come to.

        Raises:
            SimulationStopped: A guard stopped it; what is remembered stays.
        """
        begun = self.simulation.step
        while self.time_s < until_s - 1e-9 and (self.simulation.step == begun or perf_counter() < deadline):
            if self._poke_ends_s >= 0 and self.time_s >= self._poke_ends_s:
                self._poke_ends_s = -1.0
                self.plant.push(np.zeros((self.plant.geometry.n_crossings, 3)))
            self.simulation.advance()
            if self.time_s >= self._next_sample_s:
                self._record_signals()
        if self.simulation.step > begun:
            self._record()

    def poke(self, place_m: Array, force_N: Array) -> None:
        """Pushes the skin about a place in the model's axes, m, for a short time; its crossings share the force."""
        away = np.linalg.norm(np.asarray(self.plant.read(True)["crossing_position"]) - place_m, axis=-1)
        share = np.exp(-0.5 * ((away - away.min()) / POKE_RADIUS_M) ** 2)
        self.plant.push((share / share.sum())[:, np.newaxis] * force_N)
        self._poke_ends_s = self.time_s + POKE_S

    def _record(self) -> None:
        now = self.simulation
        kept = (_posture(self.config.body, now.plant), now.activation, now.sensation.contact_force_N)
        self.history.add(Moment(self.time_s, *(array.astype(np.float32) for array in kept)))

    def _record_signals(self) -> None:
        controller = self.simulation.controller
        potential = controller.read(False).get("potential", ()) if isinstance(controller, Records) else ()
        self.history.add_sample(self.time_s, np.concatenate([np.asarray(potential), self.simulation.activation]))
        self._next_sample_s = self.time_s + SAMPLE_S


def _posture(body: BodyKind, plant: Plant) -> Array:
    """Where a body is now, as a `Moment` has it."""
    if isinstance(plant, WormPlant):
        return plant.coordinates
    assert isinstance(plant, Records)
    if body.own_model is not None:
        return np.asarray(plant.read(True)["qpos"])
    return body.outlines({**plant.read(False), **plant.read(True)})


def knobs_of(config: RunConfig) -> tuple[Knob, ...]:
    """Returns what can be turned while a worm runs; sensors only where its controller uses them."""
    body, arena, controller, sensor = config.body, config.arena, config.controller, config.sensor
    knobs = [*(() if arena is None else arena.knobs()), *body.knobs()]
    if "tolerance_m" in controller.sensor_fields:
        most = above(1e3 * sensor.tolerance_m, 40.0)
        near = "A stretch sensor is on while its segment is within this of its rest length."
        knobs.append(Knob("sensor.tolerance_m", "sensor tolerance (mm)", 1e3, 0.0, most, 0.5, near))
    if "noise_m" in controller.sensor_fields:
        most = above(1e3 * sensor.noise_m, 10.0)
        noise = "Standard deviation of the noise on every reading of a stretch sensor."
        knobs.append(Knob("sensor.noise_m", "sensor noise (mm)", 1e3, 0.0, most, 0.1, noise))
    return (*knobs, *controller.knobs())


def _endless(config: RunConfig) -> RunConfig:
    return config.model_copy(update={"duration_s": ENDLESS_S})
