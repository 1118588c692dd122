"""A worm of masses on damped springs, and a controller of phase oscillators: small, and with a state to lose."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np

from annelid.config import RunConfig, load_config
from annelid.protocols import Array, Recordable, Sensation, Signal, State

N = 3
REST_M = 0.1


class ToyPlant:
    """Every segment is a damped spring that its muscle stretches, shaken by a random force.

    Args:
        timestep_s: Control step, s.
        pause_s: Wall-clock time that each step takes, s.
        alarm_at: Control step at which the plant is alarmed.
        nan_at: Control step at which a length becomes NaN.
        shaking_N: Standard deviation of the random force, N.
    """

    n_segments = N
    n_muscles = N

    def __init__(
        self,
        timestep_s: float = 0.001,
        pause_s: float = 0.0,
        alarm_at: int = -1,
        nan_at: int = -1,
        shaking_N: float = 0.01,
    ) -> None:
        self._timestep_s = timestep_s
        self._pause_s = pause_s
        self._alarm_at = alarm_at
        self._nan_at = nan_at
        self._shaking_N = shaking_N
        self.seed = -1

    def reset(self, seed: int) -> Sensation:
        self.seed = seed
        self._generator = np.random.Generator(np.random.MT19937(seed))
        self._stretch = np.zeros(N)
        self._velocity = np.zeros(N)
        self._activation = np.zeros(N)
        self._steps = 0
        return self._feel()

    def step(self, activation: Array) -> Sensation:
        if self._pause_s:
            time.sleep(self._pause_s)
        self._steps += 1
        self._activation = np.array(activation)
        force = activation + self._shaking_N * self._generator.standard_normal(N)
        acceleration = (force - 40 * self._stretch - 0.5 * self._velocity) / 0.1
        self._velocity = self._velocity + self._timestep_s * acceleration
        self._stretch = self._stretch + self._timestep_s * self._velocity
        if self._steps == self._nan_at:
            self._stretch[1] = np.nan
        return self._feel()

    def _feel(self) -> Sensation:
        return Sensation(
            time_s=self._steps * self._timestep_s,
            stretch_m=(REST_M + self._stretch)[:, None],
            rest_stretch_m=np.full((N, 1), REST_M),
            ring_length_m=0.5 - self._stretch,
            muscle_force_N=self._activation.copy(),
            contact_force_N=np.zeros((N, 3)),
            center_of_mass_m=np.full(3, np.nan),
        )

    def alarm(self) -> str | None:
        return "kinetic energy is 21 J, above 20 J" if self._steps == self._alarm_at else None


class SavedToyPlant(ToyPlant):
    """The same with every capability: it records signals and frames, and can be saved."""

    def recordable(self) -> Recordable:
        return Recordable(
            signals=(
                Signal("stretch_length", ("segment", "sensor"), (N, 1), "m", "length of a segment"),
                Signal("kinetic_energy", (), (), "J", "kinetic energy"),
                Signal("control_steps", (), (), "1", "steps taken"),
                Signal("qpos", ("coordinate",), (N,), "1", "generalised position", every_frame=True),
            ),
            attrs={"total_mass_kg": 0.1 * N},
        )

    def read(self, frame: bool) -> Mapping[str, Array | float]:
        if frame:
            return {"qpos": self._stretch}
        return {
            "stretch_length": self._feel().stretch_m,
            "kinetic_energy": 0.05 * float(self._velocity @ self._velocity),
            "control_steps": self._steps,
        }

    def get_state(self) -> State:
        words = self._generator.bit_generator.state["state"]
        return {
            "motion": np.concatenate([self._stretch, self._velocity, self._activation]),
            "steps": np.array(self._steps),
            "generator": np.append(words["key"], np.uint32(words["pos"])),
        }

    def set_state(self, state: State) -> None:
        motion = np.array(state["motion"], dtype=float)
        self._stretch, self._velocity, self._activation = motion[:N], motion[N : 2 * N], motion[2 * N :]
        self._steps = int(state["steps"])
        saved = dict(self._generator.bit_generator.state)
        saved["state"] = {"key": state["generator"][:-1], "pos": int(state["generator"][-1])}
        self._generator.bit_generator.state = saved


class ToyController:
    """Phase oscillators whose speed depends on the felt length, with noise of their own."""

    def __init__(self, excess_at: int = -1) -> None:
        self._excess_at = excess_at
        self.seed = -1
        self.felt: list[Array] = []

    def reset(self, seed: int) -> None:
        self.seed = seed
        self._generator = np.random.default_rng(seed)
        self._phase = np.arange(N) * 2 * np.pi / N
        self._steps = 0
        self.felt = []

    def step(self, sensation: Sensation) -> Array:
        self._steps += 1
        self.felt.append(sensation.stretch_m)
        speed = 20 + 100 * (sensation.stretch_m[:, 0] - REST_M) + self._generator.standard_normal(N)
        self._phase = self._phase + 0.001 * speed
        activation = 0.5 + 0.5 * np.sin(self._phase)
        if self._steps == self._excess_at:
            activation[1] = 1.5
        return activation

    def recordable(self) -> Recordable:
        return Recordable(
            signals=(Signal("potential", ("neuron",), (N,), "mV", "membrane potential"),),
            coords={"neuron": [f"contraction_{i + 1}" for i in range(N)]},
        )

    def read(self, frame: bool) -> Mapping[str, Array | float]:
        return {} if frame else {"potential": self._phase}

    def get_state(self) -> State:
        inner = self._generator.bit_generator.state
        number = [inner["state"]["state"], inner["state"]["inc"]]
        words = [word for value in number for word in (value >> 64, value & (2**64 - 1))]
        return {
            "phase": self._phase.copy(),
            "steps": np.array(self._steps),
            "generator": np.array([*words, inner["has_uint32"], inner["uinteger"]], dtype=np.uint64),
        }

    def set_state(self, state: State) -> None:
        self._phase = np.array(state["phase"], dtype=float)
        self._steps = int(state["steps"])
        a, b, c, d, has, integer = (int(word) for word in state["generator"])
        self._generator.bit_generator.state = {
            "bit_generator": "PCG64",
            "state": {"state": a << 64 | b, "inc": c << 64 | d},
            "has_uint32": has,
            "uinteger": integer,
        }


@contextmanager
def without_digest(path: Path) -> Iterator[h5py.File]:
    """Opens a run file to be changed, and leaves it as older versions of annelid wrote theirs, without a digest.

    HDF5 cuts off what lies behind its data when it has changed a file.
    """
    with h5py.File(path, "r+") as file:
        file.attrs.pop("schema_version", None)
        yield file


class ForgetfulController:
    """Full activation for ever; it records nothing and cannot be saved."""

    def reset(self, seed: int) -> None:
        pass

    def step(self, sensation: Sensation) -> Array:
        return np.ones(N)


def toy_config(**overrides: object) -> RunConfig:
    """Returns a configuration for the toys; dots of a path are written as double underscores."""
    base = {"body.kind": "riddle2022", "duration_s": 0.2, "name": "toy", "clock.physics_timestep_s": 0.001}
    return load_config({}, base | {key.replace("__", "."): value for key, value in overrides.items()})
