"""Controllers of a network with a half-centre a segment: how they stride, record and drive the muscles."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import fields
from itertools import pairwise
from typing import Generic, TypeVar

import numpy as np

from annelid import config as settings
from annelid.config.sections import Section
from annelid.control.base import SegmentController
from annelid.control.stretch_sensor import StretchSensor
from annelid.errors import ConfigError
from annelid.nervous import Network, PeristalsisParameters
from annelid.nervous.half_centre import HalfCentre
from annelid.nervous.peristalsis import ROLES
from annelid.nervous.stepper import Scheme
from annelid.protocols import Array, Sensation, State, Values

Design = TypeVar("Design", bound=HalfCentre)
Config = TypeVar("Config", settings.SnsController, settings.AdaptiveSns, settings.PressureSns)


def design_of(kind: type[Design], section: Section) -> Design:
    """Returns the design whose parameters a section of the configuration has under the same names.

    Raises:
        ConfigError: The design refuses them.
    """
    return kind(**{field.name: getattr(section, field.name) for field in fields(kind)})


def require_step_within(control_timestep_s: float, **longest_s: float) -> None:
    """Refuses a control step that is longer than a time constant of the section ``controller``, given by its name."""
    for name, value in longest_s.items():
        if not control_timestep_s <= value:
            raise ConfigError(
                f"controller.{name} = {value:g}: must be at least {control_timestep_s:g}, the control timestep"
            )


class NeuralController(SegmentController):
    """A compiled network whose potentials drive the muscles.

    A segment's activation is a function of its contraction minus its expansion neuron, U1 - U2:
    ``1 / (1 + exp(-slope (U1 - U2)))`` (Riddle et al. 2023, Eq. 2, whose printed exponent has the other sign), or
    ``0.5 + clip(U1 - U2, -R, R) / (2 R)`` (Riddle et al. 2022).
    """

    recorded = (
        ("potential", ("neuron",), "mV", "membrane potential relative to rest"),
        (
            "sodium_gate",
            ("neuron",),
            "1",
            "inactivation gate h of the persistent sodium channel; NaN for neurons without one",
        ),
    )

    _range_mV: float

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
        """Compiles the network.

        Args:
            network: Its neurons are those of one segment after another, then any others.
            roles: Names of a segment's neurons, in order; ``"contraction"`` and ``"expansion"`` are among them.
            n_segments: Segments.
            n_muscles: ``n_segments``, or twice that for half-rings (left, right, segment by segment).
            control_timestep_s: Step of the network, s.
            scheme: How it steps.
            slope_per_mV: Slope of the sigmoid.
            linear_range_mV: R of the linear activation, which then takes the sigmoid's place.
        """
        super().__init__(n_segments, n_muscles)
        self._timestep_s = control_timestep_s
        self._stepper = network.compile(1e3 * control_timestep_s, scheme)
        self._state = self._stepper.initial_state()
        self._of_role = {role: slice(place, n_segments * len(roles), len(roles)) for place, role in enumerate(roles)}
        self._slope_per_mV = slope_per_mV
        self._linear_range_mV = linear_range_mV

    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step, as `stride`."""
        return self.stride(sensation, 1)

    @abstractmethod
    def stride(self, sensation: Sensation, n_steps: int) -> Array:
        """Advances by control steps that feel the same but for their times; bit for bit as so many calls of `step`.

        Args:
            sensation: What the body feels at the beginning of the first step; its time is a multiple of the
                control step, and goes on.
            n_steps: Control steps, at least 1.

        Returns:
            Activation of every muscle in [0, 1] after the last step, shape ``(n_muscles,)``.
        """

    def _activation(self, potential: Array) -> Array:
        """Activation of every muscle, ``(.., n_muscles)``, from potentials, ``(.., n_neurons)``."""
        difference = potential[..., self._of_role["contraction"]] - potential[..., self._of_role["expansion"]]
        reach = self._linear_range_mV
        if reach is not None:
            activation = 0.5 + np.minimum(np.maximum(difference, -reach), reach) / (2.0 * reach)
        else:
            activation = 1.0 / (1.0 + np.exp(-self._slope_per_mV * difference))
        return activation if self._muscles_per_segment == 1 else activation.repeat(self._muscles_per_segment, axis=-1)

    def _activity(self, neuron: int) -> float:
        """Activity of a neuron by its place: its potential over the range, in [0, 1]."""
        return min(max(float(self._state.potential[0, neuron]) / self._range_mV, 0.0), 1.0)

    def _values(self) -> Values:
        arrays = self._stepper.arrays
        gate = np.full(len(arrays.neurons), np.nan)
        gate[arrays.channel_neuron] = self._state.gate[0, 0]
        return {"potential": self._state.potential[0].copy(), "sodium_gate": gate}

    def _coords(self) -> dict[str, list[int] | list[str]]:
        return {"neuron": list(self._stepper.arrays.neurons), "segment": list(range(1, self._n_segments + 1))}

    def get_state(self) -> State:
        """Returns copies of potentials (mV) and gates."""
        return {"potential": self._state.potential.copy(), "gate": self._state.gate.copy()}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        self._state.potential[...] = state["potential"]
        self._state.gate[...] = state["gate"]


class PeristalsisController(NeuralController, Generic[Config]):
    """A controller of the paper's network, or of one that extends it, held and let go by stretch sensors.

    One step, from t to t + dt: the lengths sensed at t switch the sensors, whose currents act on the network
    during the whole step; the activation is read from the potentials at t + dt and drives the body from t on.
    This is the order of the authors' loop. The kick acts during the first step only.

    Raises:
        ConfigError: Fewer than 3 segments, muscles that are neither one nor two a segment, network parameters for
            which a design rule has no solution, or a control step beyond a neuron's time constant.
    """

    recorded = (
        *NeuralController.recorded,
        (
            "sensor_on",
            ("segment",),
            "1",
            "stretch sensor during the last control step: 1 while the segment is at rest length",
        ),
    )
    _parameters: PeristalsisParameters
    _every_step_differs = False

    def __init__(
        self,
        config: Config,
        sensor: settings.StretchSensor,
        n_segments: int,
        n_muscles: int,
        control_timestep_s: float,
    ) -> None:
        """Builds the controller in its initial state.

        Args:
            config: Its section of the configuration.
            sensor: Section of the stretch sensors; their noise is the simulation's business, not used here.
            n_segments: Segments, at least 3.
            n_muscles: ``n_segments``, or twice that for half-rings (left, right, segment by segment).
            control_timestep_s: Step of the network, s.
        """
        self._config = config
        self._sns = sns = config if isinstance(config, settings.SnsController) else config.network
        self._parameters = design_of(PeristalsisParameters, sns)
        self._range_mV, self._full_nA = sns.range_mV, sns.leak_conductance_uS * sns.range_mV
        super().__init__(
            self._network(n_segments, control_timestep_s),
            ROLES,
            n_segments,
            n_muscles,
            control_timestep_s,
            scheme=sns.scheme,
            slope_per_mV=sns.activation_slope_per_mV,
            linear_range_mV=sns.range_mV if sns.activation == "linear" else None,
        )
        self._sensor = StretchSensor(sensor, n_segments)
        self._inputs_nA = np.zeros(len(self._stepper.arrays.inputs))
        self.reset(0)

    @abstractmethod
    def _network(self, n_segments: int, control_timestep_s: float) -> Network:
        """Returns the paper's network, with any further neurons and inputs behind its own."""

    def _feel(self, sensation: Sensation, time_s: float) -> None:
        """Writes the currents of the further inputs behind those of the sensors and the kick."""

    def reset(self, seed: int) -> None:
        """Returns to the initial state: segment 1 contracted, the others expanded; nothing here is random."""
        self._state = self._stepper.initial_state(self._sns.gate_start)
        self._sensor.reset()
        self._n_steps = 0

    def stride(self, sensation: Sensation, n_steps: int) -> Array:
        """Advances by control steps, as `NeuralController.stride`."""
        n_segments, inputs = self._n_segments, self._inputs_nA
        for n, time_s in self._pieces(self._n_steps, sensation.time_s, n_steps):
            on = self._sensor.read(sensation.stretch_m, sensation.rest_stretch_m, time_s)
            np.multiply(on, self._sns.sensor_current_nA, out=inputs[:n_segments])
            inputs[n_segments] = self._sns.kick_nA if self._n_steps == 0 else 0.0
            self._feel(sensation, time_s)
            self._stepper.advance(self._state, inputs, n)
            self._n_steps += n
        return self._activation(self._state.potential[0])

    def _pieces(self, n_taken: int, time_s: float, n_steps: int) -> list[tuple[int, float]]:
        """Cuts steps under one sensation where the inputs change: after the kick, and at the end of the hold.

        Returns:
            For every piece its number of steps and the time at its beginning, s.
        """
        held = self._sensor.held_at(time_s)
        if n_steps == 1 or (n_taken > 0 and not held and not self._every_step_differs):
            return [(n_steps, time_s)]
        first = round(time_s / self._timestep_s)
        times_s = [time_s, *((first + k) * self._timestep_s for k in range(1, n_steps))]
        if self._every_step_differs:
            return [(1, time_s) for time_s in times_s]
        cuts = {0, n_steps} | ({1} if n_taken == 0 else set())
        if held:
            cuts.add(sum(self._sensor.held_at(time) for time in times_s))
        return [(end - start, times_s[start]) for start, end in pairwise(sorted(cuts))]

    def _values(self) -> Values:
        return {**super()._values(), "sensor_on": self._sensor.on.astype(np.float64)}

    def get_state(self) -> State:
        """Returns copies of potentials (mV), gates, sensors and the number of steps taken."""
        return super().get_state() | {"sensor_on": self._sensor.on.copy(), "n_steps": np.array(self._n_steps)}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        super().set_state(state)
        self._sensor.on[...] = state["sensor_on"]
        self._n_steps = int(state["n_steps"])
