"""A worm that runs while it is watched: changed, poked and started anew; and what is remembered of it, or of a run."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter, itemgetter
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from annelid.config import BodyKind, Knob, RunConfig, load_config
from annelid.config.kinds import above
from annelid.draw.scene import postures_of
from annelid.morphology import Array
from annelid.protocols import Plant, Records
from annelid.simulation.adjust import adjusted
from annelid.simulation.runfile import Run
from annelid.simulation.stepping import Simulation, build_controller, build_plant, start
from annelid.simulation.worm import WormPlant

KEEP_BYTES = 200_000_000  # a live view forgets the oldest postures beyond this
KEEP_S = 600.0  # and the oldest of anything, in simulated time
ENDLESS_S = 1e7  # a live worm runs until the view ends; its configuration keeps the duration that it has
SAMPLE_S = 0.01  # signals for the plots are kept at most this often, in simulated time
POKE_S = 0.15  # how long a poke lasts, in simulated time
POKE_RADIUS_M = 0.06
"""Distance from the middle of a poke at which its force has fallen to 0.6, as under the flat of a hand."""
_TRIM_EVERY = 64
_time_of = attrgetter("time_s")


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """A worm at one instant."""

    time_s: float
    qpos: NDArray[np.floating]  # generalised positions, (nq,), or the outlines of a planar body, m
    activation: NDArray[np.floating]  # of every ring muscle, in [0, 1], (n_muscles,)
    contact_force_N: NDArray[np.floating]  # of the ground on every segment, (n_segments, 3)


class Reel:
    """Moments in the order of time, and samples of signals between them.

    The signals are named after neurons (mV), then ``activation_1`` .. of the muscles.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self._moments: list[Moment] = []
        self._samples: list[tuple[float, NDArray[np.floating]]] = []

    @property
    def span_s(self) -> tuple[float, float]:
        """Times of the first and the last moment kept, s."""
        return self._moments[0].time_s, self._moments[-1].time_s

    def add(self, moment: Moment) -> None:
        """Adds a moment later than all others."""
        self._moments.append(moment)

    def add_sample(self, time_s: float, values: NDArray[np.floating]) -> None:
        """Adds the signals of an instant later than all others, ``(n_signals,)``."""
        self._samples.append((time_s, values))

    def forget(self) -> None:
        """Drops the oldest moments and samples that there is no room for."""
        most = max(2, KEEP_BYTES // max(1, self._moments[-1].qpos.nbytes))
        too_old = bisect_left(self._moments, self._moments[-1].time_s - KEEP_S, key=_time_of)
        excess = max(len(self._moments) - most, too_old)
        if excess >= _TRIM_EVERY:
            del self._moments[:excess]
            del self._samples[: bisect_left(self._samples, self._moments[0].time_s, key=itemgetter(0))]

    def at(self, time_s: float) -> Moment:
        """Returns the last moment that is not after a time, or the first one."""
        return self._moments[max(0, bisect_right(self._moments, time_s + 1e-9, key=_time_of) - 1)]

    def window(self, first_s: float, last_s: float, most: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Returns times, s, ``(n,)``, and signals, ``(n, n_signals)``, of a stretch of time, evenly thinned."""
        start = bisect_left(self._samples, first_s, key=itemgetter(0))
        stop = bisect_right(self._samples, last_s + 1e-9, key=itemgetter(0))
        every = max(1, -(-(stop - start) // most))
        # On the same samples from one call to the next, or the curves would shimmer.
        taken = self._samples[start + -start % every : stop : every]
        values = np.array([sample for _, sample in taken], dtype=np.float64).reshape(-1, len(self.names))
        return np.array([time for time, _ in taken]), values


class LivingWorm:
    """Body and nervous system from time zero on, and a reel of what is remembered of them."""

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
        self.reel = Reel(signal_names(map(str, neurons), plant.n_muscles))
        self._remember_signals()
        self._remember()

    def as_at_first(self) -> None:
        """Gives all fields the values that the worm came with; it goes on from where it is."""
        self._take(self._first)

    def adjust(self, values: Mapping[str, Any]) -> None:
        """Changes fields of the configuration by dotted path; the worm goes on from where it is.

        Raises:
            ConfigError: A value is out of range, or the body cannot be built with it; nothing has changed then.
        """
        self._take(load_config(self.config.model_dump(), values))

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
                self._remember_signals()
        if self.simulation.step > begun:
            self._remember()

    def poke(self, place_m: Array, force_N: Array) -> None:
        """Pushes the skin about a place in the model's axes, m, for a short time; its crossings share the force."""
        away = np.linalg.norm(np.asarray(self.plant.read(True)["crossing_position"]) - place_m, axis=-1)
        share = np.exp(-0.5 * ((away - away.min()) / POKE_RADIUS_M) ** 2)
        self.plant.push((share / share.sum())[:, np.newaxis] * force_N)
        self._poke_ends_s = self.time_s + POKE_S

    def _remember(self) -> None:
        now = self.simulation
        kept = (_posture(self.config.body, now.plant), now.activation, now.sensation.contact_force_N)
        self.reel.add(Moment(self.time_s, *(array.astype(np.float32) for array in kept)))
        self.reel.forget()

    def _remember_signals(self) -> None:
        controller = self.simulation.controller
        potential = controller.read(False).get("potential", ()) if isinstance(controller, Records) else ()
        self.reel.add_sample(self.time_s, np.concatenate([np.asarray(potential), self.simulation.activation]))
        self._next_sample_s = self.time_s + SAMPLE_S


def _posture(body: BodyKind, plant: Plant) -> Array:
    """Where a body is now, as a `Moment` has it."""
    if isinstance(plant, WormPlant):
        return plant.qpos
    assert isinstance(plant, Records)
    return body.outlines({**plant.read(False), **plant.read(True)})


def signal_names(neurons: Iterable[str], n_muscles: int) -> tuple[str, ...]:
    """Names of a reel's signals."""
    return (*neurons, *(f"activation_{muscle + 1}" for muscle in range(n_muscles)))


def reel_of(run: Run, n_coordinates: int | None) -> Reel:
    """Returns the moments and signals that a run has recorded, of a 3D worm of so many coordinates or a planar body."""
    data = run.data
    if n_coordinates is None:
        recorded = {str(name): signal.values for name, signal in data.items()}
        postures, moments = run.config.body.outlines(recorded), data["time"].values
    else:
        postures, moments = postures_of(run, n_coordinates), data["frame_time"].values
    neurons = [str(name) for name in data["neuron"].values] if "potential" in data else []
    activation = data["activation"].values
    reel = Reel(signal_names(neurons, activation.shape[1]))
    times = data["time"].values
    signals = np.concatenate([data["potential"].values, activation], axis=1) if neurons else activation
    for time, values in zip(times, signals, strict=True):
        reel.add_sample(float(time), values)
    sample = np.clip(np.searchsorted(times, moments + 1e-9, side="right") - 1, 0, None)
    force = (
        data["contact_force"].values if "contact_force" in data else np.zeros((len(times), data.sizes["segment"], 3))
    )
    for number, time in enumerate(moments):
        reel.add(Moment(float(time), postures[number], activation[sample[number]], force[sample[number]]))
    return reel


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
