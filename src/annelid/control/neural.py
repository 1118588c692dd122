"""Controllers of a network with a half-centre a segment: how they stride, record and drive the muscles."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import fields
from typing import TypeVar

import numpy as np

from annelid.config.sections import Section
from annelid.control.base import SegmentController
from annelid.errors import ConfigError
from annelid.nervous import Network
from annelid.nervous.half_centre import HalfCentre
from annelid.nervous.stepper import Scheme
from annelid.protocols import Array, Sensation, State, Values

Design = TypeVar("Design", bound=HalfCentre)


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
