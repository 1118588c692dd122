"""The controller whose rhythm goes on whatever its sensors say: the robust peristalsis network on a body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from annelid import config as settings
from annelid.control.muscles import muscles_a_segment
from annelid.errors import ConfigError
from annelid.nervous.robust import ROLES, RobustParameters, neuron_names, robust_network
from annelid.protocols import Array, Recordable, Sensation, Signal, State

_CONTRACTION, _EXPANSION = ROLES.index("contraction"), ROLES.index("expansion")


class RobustController:
    """Drives a worm by `annelid.nervous.robust`.

    One step, from t to t + dt: the segments' mean lengthening at t, graded and clipped, drives the stretch neurons
    during the whole step; activation is ``1 / (1 + exp(-slope (U1 - U2)))`` of the contraction and expansion neurons at
    t + dt. Nothing but potentials and gates is remembered.

    Raises:
        ConfigError: Fewer than 3 segments, muscles that are neither one nor two a segment, network parameters for
            which a design rule has no solution, or a control step at which the network would not be stable.
    """

    def __init__(self, config: settings.RobustSns, n_segments: int, n_muscles: int, control_timestep_s: float) -> None:
        """Builds the controller in its initial state.

        Args:
            config: Its section of the configuration.
            n_segments: Segments, at least 3.
            n_muscles: ``n_segments``, or twice that for half-rings (left, right, segment by segment).
            control_timestep_s: Step of the network, s.
        """
        self._config = config
        self._n_segments = n_segments
        self._muscles_a_segment = muscles_a_segment(n_segments, n_muscles)
        self._parameters = RobustParameters(
            **{field.name: getattr(config, field.name) for field in fields(RobustParameters)}
        )
        network = robust_network(n_segments, self._parameters)
        longest_s = network.stable_timestep_ms() / 1e3
        if control_timestep_s > longest_s:
            raise ConfigError(
                f"clock.control_timestep_s = {control_timestep_s:g} must be at most {longest_s:.3g}, beyond which the "
                f"network of {n_segments} segments may be unstable"
            )
        self._stepper = network.compile(1e3 * control_timestep_s, config.scheme)
        self._full_nA = config.leak_conductance_uS * config.range_mV
        self._no_gates = np.full(len(self._stepper.arrays.neurons), np.nan)
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Returns to the state that ``start`` names.

        It is segment 1 contracted and the others held (``"design"``); all potentials at rest, gates steady there
        (``"silent"``); or potentials drawn evenly from the inhibitory reversal to three ranges and gates from 0 to 1
        (``"random"``).

        Args:
            seed: Of what is drawn.
        """
        self._state = self._stepper.initial_state()
        potential, gate = self._state.potential, self._state.gate
        if self._config.start == "silent":
            potential[...] = 0.0
            [inactivation] = self._parameters.sodium_channel.slow_gates
            gate[...] = inactivation.steady(0.0)
        elif self._config.start == "random":
            rng = np.random.default_rng(seed)
            potential[...] = rng.uniform(
                self._config.inhibitory_reversal_mV, 3.0 * self._config.range_mV, potential.shape
            )
            gate[...] = rng.random(gate.shape)

    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step.

        Args:
            sensation: What the body feels at the beginning of the step; lengths are used.

        Returns:
            Activation of every muscle in [0, 1], shape ``(n_muscles,)``; both halves of a ring alike.
        """
        return self.stride(sensation, 1)

    def stride(self, sensation: Sensation, n_steps: int) -> Array:
        """Advances by control steps that feel the same lengths; bit for bit the same as so many calls of `step`.

        Args:
            sensation: What the body feels at the beginning of the first step.
            n_steps: Control steps, at least 1.

        Returns:
            Activation after the last step, as `step` returns it.
        """
        self._stepper.advance(self._state, self._full_nA * self._stretch(sensation), n_steps)
        by_segment = self._state.potential[0, :-1].reshape(self._n_segments, -1)
        difference = by_segment[:, _CONTRACTION] - by_segment[:, _EXPANSION]
        activation = 1.0 / (1.0 + np.exp(-self._config.activation_slope_per_mV * difference))
        return activation.repeat(self._muscles_a_segment)

    def _stretch(self, sensation: Sensation) -> Array:
        """Mean lengthening of every segment over its full scale, in [0, 1], ``(n_segments,)``."""
        lengthening_m = (sensation.stretch_m - sensation.rest_stretch_m).mean(axis=1)
        return np.clip(lengthening_m / self._config.full_stretch_m, 0.0, 1.0)

    def recordable(self) -> Recordable:
        """Names potentials, sodium gates and the stretch neurons' activity."""
        names = neuron_names(self._n_segments)
        return Recordable(
            signals=(
                Signal("potential", ("neuron",), (len(names),), "mV", "membrane potential relative to rest"),
                Signal(
                    "sodium_gate",
                    ("neuron",),
                    (len(names),),
                    "1",
                    "inactivation gate h of the persistent sodium channel; NaN for neurons without one",
                ),
                Signal("stretch_activity", ("segment",), (self._n_segments,), "1", "activity of the stretch neuron"),
            ),
            coords={"neuron": names, "segment": list(range(1, self._n_segments + 1))},
            attrs={"controller": "robust synthetic nervous system", "turn_ms": self._parameters.turn_ms},
        )

    def read(self, frame: bool) -> Mapping[str, NDArray[np.generic] | float]:
        """Reads the signals that `recordable` names; there are none at frame rate."""
        if frame:
            return {}
        potential = self._state.potential[0]
        gate = self._no_gates.copy()
        gate[self._stepper.arrays.channel_neuron] = self._state.gate[0, 0]
        stretch = potential[:-1].reshape(self._n_segments, -1)[:, ROLES.index("stretch")]
        return {
            "potential": potential.copy(),
            "sodium_gate": gate,
            "stretch_activity": np.clip(stretch / self._parameters.range_mV, 0.0, 1.0),
        }

    def get_state(self) -> State:
        """Returns copies of potentials (mV) and gates."""
        return {"potential": self._state.potential.copy(), "gate": self._state.gate.copy()}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        self._state.potential[...] = state["potential"]
        self._state.gate[...] = state["gate"]
