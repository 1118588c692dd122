"""What controllers of a network with a half-centre a segment share: state, signals, and the muscles' activation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from itertools import pairwise
from typing import TypeVar

import numpy as np

from annelid import config as settings
from annelid.config.sections import Section
from annelid.control.muscles import muscles_a_segment
from annelid.control.stretch_sensor import StretchSensor
from annelid.nervous import Network
from annelid.nervous.half_centre import HalfCentre
from annelid.nervous.peristalsis import ROLES
from annelid.nervous.stepper import Scheme
from annelid.protocols import Array, Recordable, Signal, State, Values

Design = TypeVar("Design", bound=HalfCentre)


def design_of(kind: type[Design], section: Section) -> Design:
    """Returns the design whose parameters a section of the configuration has under the same names.

    Raises:
        ConfigError: The design refuses them.
    """
    return kind(**{field.name: getattr(section, field.name) for field in fields(kind)})


class NeuralController:
    """A compiled network whose potentials drive the muscles.

    A segment's activation is a function of its contraction minus its expansion neuron, U1 - U2:
    ``1 / (1 + exp(-slope (U1 - U2)))`` (Riddle et al. 2023, Eq. 2, whose printed exponent has the other sign), or
    ``0.5 + clip(U1 - U2, -R, R) / (2 R)`` (Riddle et al. 2022).
    """

    def __init__(
        self,
        network: Network,
        roles: Sequence[str],
        n_segments: int,
        n_muscles: int,
        control_timestep_s: float,
        *,
        scheme: Scheme,
        slope_per_mV: float,
        linear_range_mV: float | None = None,
    ) -> None:
        """Compiles the network, whose state stays unset until `reset`.

        Args:
            network: Its neurons are those of one segment after another, then any others.
            roles: Names of a segment's neurons, in order; ``"contraction"`` and ``"expansion"`` are among them.
            n_segments: Segments.
            n_muscles: ``n_segments``, or twice that for half-rings (left, right, segment by segment).
            control_timestep_s: Step of the network, s.
            scheme: How it steps.
            slope_per_mV: Slope of the sigmoid.
            linear_range_mV: R of the linear activation, which then takes the sigmoid's place.

        Raises:
            ConfigError: Muscles that are neither one nor two a segment.
        """
        self._n_segments = n_segments
        self._muscles_a_segment = muscles_a_segment(n_segments, n_muscles)
        self._timestep_s = control_timestep_s
        self._stepper = network.compile(1e3 * control_timestep_s, scheme)
        self._state = self._stepper.initial_state()
        self._of_role = {role: slice(place, n_segments * len(roles), len(roles)) for place, role in enumerate(roles)}
        self._slope_per_mV = slope_per_mV
        self._linear_range_mV = linear_range_mV
        self._no_gates = np.full(len(self._stepper.arrays.neurons), np.nan)

    def _activation(self, potential: Array) -> Array:
        """Activation of every muscle, ``(.., n_muscles)``, from potentials, ``(.., n_neurons)``."""
        difference = potential[..., self._of_role["contraction"]] - potential[..., self._of_role["expansion"]]
        reach = self._linear_range_mV
        if reach is not None:
            activation = 0.5 + np.minimum(np.maximum(difference, -reach), reach) / (2.0 * reach)
        else:
            activation = 1.0 / (1.0 + np.exp(-self._slope_per_mV * difference))
        return activation if self._muscles_a_segment == 1 else activation.repeat(self._muscles_a_segment, axis=-1)

    def _potential_signal(self) -> Signal:
        n_neurons = len(self._stepper.arrays.neurons)
        return Signal("potential", ("neuron",), (n_neurons,), "mV", "membrane potential relative to rest")

    def _sodium_gate_signal(self) -> Signal:
        return Signal(
            "sodium_gate",
            ("neuron",),
            (len(self._stepper.arrays.neurons),),
            "1",
            "inactivation gate h of the persistent sodium channel; NaN for neurons without one",
        )

    def _named(self, *signals: Signal, **attrs: float | str) -> Recordable:
        """Signals whose dimensions are neurons and segments, with these attributes."""
        segments = list(range(1, self._n_segments + 1))
        coords = {"neuron": list(self._stepper.arrays.neurons), "segment": segments}
        return Recordable(signals=signals, coords=coords, attrs=attrs)

    def _potential(self) -> Array:
        """A copy of all potentials, mV, ``(n_neurons,)``."""
        return self._state.potential[0].copy()

    def _sodium_gate(self) -> Array:
        """The gate of every neuron, NaN where there is none, ``(n_neurons,)``."""
        gate = self._no_gates.copy()
        gate[self._stepper.arrays.channel_neuron] = self._state.gate[0, 0]
        return gate

    def get_state(self) -> State:
        """Returns copies of potentials (mV) and gates."""
        return {"potential": self._state.potential.copy(), "gate": self._state.gate.copy()}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        self._state.potential[...] = state["potential"]
        self._state.gate[...] = state["gate"]


class PeristalsisController(NeuralController):
    """A controller of the paper's network, or of one that extends it, held and let go by stretch sensors."""

    def __init__(
        self,
        network: Network,
        config: settings.SnsController,
        sensor: settings.StretchSensor,
        n_segments: int,
        n_muscles: int,
        control_timestep_s: float,
    ) -> None:
        """Builds the controller in its initial state.

        Args:
            network: `annelid.nervous.peristalsis_network`, with any further neurons behind its own.
            config: Section of the network, its scheme and its activation.
            sensor: Section of the stretch sensors.
            n_segments: Segments.
            n_muscles: ``n_segments``, or twice that for half-rings (left, right, segment by segment).
            control_timestep_s: Step of the network, s.

        Raises:
            ConfigError: Muscles that are neither one nor two a segment.
        """
        super().__init__(
            network,
            ROLES,
            n_segments,
            n_muscles,
            control_timestep_s,
            scheme=config.scheme,
            slope_per_mV=config.activation_slope_per_mV,
            linear_range_mV=config.range_mV if config.activation == "linear" else None,
        )
        self._sns = config
        self._sensor = StretchSensor(sensor, n_segments)
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Returns to the initial state: segment 1 contracted, the others expanded; nothing here is random."""
        self._state = self._stepper.initial_state(self._sns.gate_start)
        self._sensor.reset()
        self._n_steps = 0

    def _pieces(self, n_taken: int, time_s: float, n_steps: int) -> list[tuple[int, float]]:
        """Cuts steps under one sensation where the inputs change: after the kick, and at the end of the hold.

        Returns:
            For every piece its number of steps and the time at its beginning, s.
        """
        held = self._sensor.held_at(time_s)
        if n_steps == 1 or (n_taken > 0 and not held):
            return [(n_steps, time_s)]
        first = round(time_s / self._timestep_s)
        times_s = [time_s, *((first + k) * self._timestep_s for k in range(1, n_steps))]
        cuts = {0, n_steps} | ({1} if n_taken == 0 else set())
        if held:
            cuts.add(sum(self._sensor.held_at(time) for time in times_s))
        ends = sorted(cuts)
        return [(end - start, times_s[start]) for start, end in pairwise(ends)]

    def _sensor_signal(self) -> Signal:
        return Signal(
            "sensor_on",
            ("segment",),
            (self._n_segments,),
            "1",
            "stretch sensor during the last control step: 1 while the segment is at rest length",
        )

    def _signals(self) -> tuple[Signal, ...]:
        return self._potential_signal(), self._sodium_gate_signal(), self._sensor_signal()

    def read(self, frame: bool) -> Values:
        """Reads potentials (mV), sodium gates and sensors; there is nothing at frame rate."""
        if frame:
            return {}
        return {
            "potential": self._potential(),
            "sodium_gate": self._sodium_gate(),
            "sensor_on": self._sensor.on.astype(np.float64),
        }

    def get_state(self) -> State:
        """Returns copies of potentials (mV), gates, sensors and the number of steps taken."""
        return super().get_state() | {"sensor_on": self._sensor.on.copy(), "n_steps": np.array(self._n_steps)}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        super().set_state(state)
        self._sensor.on[...] = state["sensor_on"]
        self._n_steps = int(state["n_steps"])
