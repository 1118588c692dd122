"""The paper's controller: stretch sensors, the peristalsis network, and the muscles' activation."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Hashable, Iterable
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, ClassVar, Generic, Literal, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from annelid.config.kinds import ControllerKind
from annelid.config.run import StretchSensor
from annelid.config.sections import NonNegative, Positive
from annelid.control.neural import NeuralController, design_of
from annelid.control.stretch_sensor import StretchSensor as StretchThreshold
from annelid.nervous import Network, NetworkState, PeristalsisParameters, Stepper, peristalsis_network
from annelid.nervous.peristalsis import ROLES
from annelid.protocols import Array, Plant, Sensation, State, Values

if TYPE_CHECKING:
    from annelid.config.run import RunConfig

Config = TypeVar("Config", bound=ControllerKind)
NETWORK_CITES = (("riddle2022", "the network"), ("szczecinski2017", "the rules by which synapses are designed"))
"""What every controller with the paper's network rests on."""


class Sns(ControllerKind):
    """The paper's synthetic nervous system: one half-centre a segment, gated by its neighbour's stretch."""

    sensor_fields: ClassVar[frozenset[str]] = frozenset({"tolerance_m", "noise_m"})
    tuned: ClassVar[tuple[str, ...]] = (
        "controller.gate_time_constant_ms=80:900:log",
        "controller.activation_slope_per_mV=0.1:2:log",
        "sensor.tolerance_m=0.001:0.03:log",
        "sensor.hysteresis_m=0:0.02",
    )
    kind: Literal["sns"] = "sns"
    capacitance_nF: Positive = Field(default=5.0, description="membrane capacitance C")
    leak_conductance_uS: Positive = Field(default=1.0, description="leak conductance Gm")
    range_mV: Positive = Field(default=20.0, description="operating range R")
    bifurcation_mV: Positive = Field(
        default=0.01, description="delta: how far past the bifurcation the half-centre sits"
    )
    offset_mV: Positive = Field(default=0.1, description="how far below rest an inhibited neuron is held")
    inhibitory_reversal_mV: Annotated[float, Field(lt=0)] = Field(default=-40.0, description="relative to rest")
    excitatory_reversal_mV: Positive = Field(default=194.0, description="relative to rest")
    sodium_reversal_mV: Positive = Field(default=110.0, description="relative to rest")
    gate_slope_per_mV: Annotated[float, Field(gt=0, le=10)] = Field(
        default=0.05, description="slope S of the sodium gates"
    )
    gate_time_constant_ms: Positive = Field(default=300.0, description="tau_h,max; sets the period: 300, 200 or 100")
    sensor_current_nA: NonNegative = Field(default=20.0, description="current of a stretch sensor that is on")
    kick_nA: NonNegative = Field(default=1.0, description="current into the first contraction neuron at the first step")
    activation: Literal["sigmoid", "linear"] = Field(
        default="sigmoid", description="Eq. 2, or the planar worm's clipped difference of the half-centre"
    )
    activation_slope_per_mV: Positive = Field(default=0.35, description="slope of the sigmoid")
    scheme: Literal["euler", "toolbox", "heun"] = Field(
        default="euler",
        description="forward Euler, SNS-Toolbox's order (gates before potentials), or second order",
    )
    gate_start: Literal["steady", "toolbox"] = Field(
        default="steady", description="gates start at h_inf(U), or as SNS-Toolbox starts them"
    )

    def build(self, config: RunConfig, plant: Plant) -> SnsController:
        """Builds the controller, as `ControllerKind.build`."""
        return SnsController(self, config.sensor, plant.n_segments, plant.n_muscles, config.clock.control_timestep_s)

    def cited(self) -> tuple[tuple[str, str], ...]:
        """Returns the network, and SNS-Toolbox where the steps are in its order."""
        toolbox = ("nourse2023", "how the gates start, or the order of their steps")
        return (*NETWORK_CITES, *((toolbox,) if "toolbox" in (self.scheme, self.gate_start) else ()))


def paper_network(controller: ControllerKind) -> Sns | None:
    """Returns the section of the paper's network: a controller's own or its field ``network``, else None."""
    network = getattr(controller, "network", controller)
    return network if isinstance(network, Sns) else None


def paper_controller(controller: ControllerKind) -> Sns | None:
    """Returns a controller's section if it is the paper's network and nothing else, else None."""
    return controller if isinstance(controller, Sns) else None


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
        sensor: StretchSensor,
        n_segments: int,
        n_muscles: int,
        control_timestep_s: float,
    ) -> None:
        """Builds the controller in its initial state.

        Args:
            config: Its section of the configuration, which is or has that of the paper's network.
            sensor: Section of the stretch sensors; their noise is the simulation's business, not used here.
            n_segments: Segments, at least 3.
            n_muscles: ``n_segments``, or twice that for half-rings (left, right, segment by segment).
            control_timestep_s: Step of the network, s.
        """
        self._config = config
        sns = paper_network(config)
        assert sns is not None
        self._sns = sns
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
        self._sensor = StretchThreshold(sensor, n_segments)
        self._inputs_nA = np.zeros(len(self._stepper.arrays.inputs))
        self.reset(0)

    @abstractmethod
    def _network(self, n_segments: int, control_timestep_s: float) -> Network:
        """Returns the paper's network, with any further neurons and inputs behind its own."""

    def _set_inputs(self, sensation: Sensation, time_s: float) -> None:
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
            self._set_inputs(sensation, time_s)
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


@dataclass(frozen=True, slots=True)
class CopySettings:
    """What may differ between copies that are advanced together: one number for all, or an array ``(n_copies,)``.

    Attributes:
        tolerance_m: Tolerance of the stretch sensors, m.
        hysteresis_m: Their hysteresis, m.
        sensor_current_nA: Current of a sensor that is on, nA.
        kick_nA: Current of the first step, nA.
    """

    tolerance_m: float | Array
    hysteresis_m: float | Array
    sensor_current_nA: float | Array
    kick_nA: float | Array

    @classmethod
    def of(cls, copies: Iterable[Self]) -> Self:
        """Returns those of all copies, each given with one number."""
        each = [(one.tolerance_m, one.hysteresis_m, one.sensor_current_nA, one.kick_nA) for one in copies]
        return cls(*np.array(each).reshape(-1, 4).T)


class SnsController(PeristalsisController[Sns]):
    """Drives a worm by the synthetic nervous system of Riddle et al. 2022 and 2023, as `PeristalsisController` does.

    Many copies of it can be advanced at once. A segment's activation is that of
    `annelid.control.neural.NeuralController`: ``"sigmoid"`` as in Riddle et al. 2023, ``"linear"`` as in Riddle et al.
    2022.

    Attributes:
        alike: Equal for controllers that can be advanced together as copies.
        own: What may differ between those.

    Raises:
        ConfigError: As `PeristalsisController`.
    """

    name = "synthetic nervous system"

    def __init__(
        self,
        config: Sns,
        sensor: StretchSensor,
        n_segments: int,
        n_muscles: int,
        control_timestep_s: float,
    ) -> None:
        """Builds the controller in its initial state, as `PeristalsisController`."""
        super().__init__(config, sensor, n_segments, n_muscles, control_timestep_s)
        self.own = CopySettings(sensor.tolerance_m, sensor.hysteresis_m, config.sensor_current_nA, config.kick_nA)
        differing = {"sensor_current_nA", "kick_nA"}
        self.alike: Hashable = config.model_dump_json(exclude=differing), sensor.startup_hold_s
        drive = (config.sensor_current_nA + config.kick_nA) / config.leak_conductance_uS
        reversals = config.excitatory_reversal_mV, config.sodium_reversal_mV
        self._explicable_mV = config.inhibitory_reversal_mV - drive, max(reversals) + drive
        self._batches: dict[int, tuple[Stepper, NetworkState]] = {}

    def _network(self, n_segments: int, control_timestep_s: float) -> Network:
        return peristalsis_network(n_segments, self._parameters)

    def step_copies(
        self, states: State, sensation: Sensation, n_steps: int = 1, each: CopySettings | None = None
    ) -> tuple[State, Array]:
        """Advances many copies at once, each as `stride` does one, bit for bit; changes nothing here.

        Args:
            states: As `get_state` returns them, the arrays but for the number of steps with one more axis in
                front, ``n_copies`` long.
            sensation: Lengths with the same axis in front, ``(n_copies, n_segments, n_sensors)``; one time for all.
            n_steps: Control steps under these lengths, at least 1.
            each: What differs between the copies; None for this controller's own settings.

        Returns:
            The states that many steps on, and their activation, ``(n_copies, n_muscles)``.
        """
        each = each or self.own
        tolerance, hysteresis, current = (
            np.asarray(value)[..., np.newaxis]
            for value in (each.tolerance_m, each.hysteresis_m, each.sensor_current_nA)
        )
        on = states["sensor_on"].astype(bool)
        n_copies, n_taken = len(on), int(states["n_steps"])
        stepper, batch = self._batch(n_copies)
        batch.potential[:n_copies] = states["potential"][:, 0]
        batch.gate[:n_copies] = states["gate"][:, 0]
        inputs = np.zeros((stepper.n_worms, self._n_segments + 1))
        for n, time_s in self._pieces(n_taken, sensation.time_s, n_steps):
            lengths = sensation.stretch_m, sensation.rest_stretch_m
            on = self._sensor.reading(on, *lengths, time_s, tolerance, hysteresis)
            inputs[:n_copies, :-1] = current * on
            inputs[:n_copies, -1] = each.kick_nA if n_taken == 0 else 0.0
            stepper.advance(batch, inputs, n)
            n_taken += n
        potential, gate = batch.potential[:n_copies].copy(), batch.gate[:n_copies].copy()
        after: State = {
            "potential": potential[:, np.newaxis],
            "gate": gate[:, np.newaxis],
            "sensor_on": on,
            "n_steps": np.array(n_taken),
        }
        return after, self._activation(potential)

    def _batch(self, n_copies: int) -> tuple[Stepper, NetworkState]:
        """A stepper for at least this many copies, and room for their state."""
        # Few widths of buffers serve any number of copies.
        width = 1 << (n_copies - 1).bit_length()
        if width not in self._batches:
            own = self._stepper
            stepper = Stepper(own.arrays, own.timestep_ms, own.scheme, width)
            self._batches[width] = stepper, stepper.initial_state(self._sns.gate_start)
        return self._batches[width]

    def pieces_copies(self, states: State) -> NDArray[np.bool_]:
        """Tells in which piece of its piecewise smooth equations each of many copies is.

        Synapses open between two potentials, and a linear activation saturates: there the equations have kinks.

        Args:
            states: As for `step_copies`.

        Returns:
            Shape ``(n_copies, n_pieces)``; between two of its changes the equations are smooth.
        """
        potential = states["potential"][:, 0].astype(np.float64)
        arrays = self._stepper.arrays
        opening = (potential[:, arrays.terminal_neuron] - arrays.terminal_threshold_mV) * arrays.terminal_slope_per_mV
        pieces = [opening > 0.0, opening > 1.0]
        if self._sns.activation == "linear":
            activation = self._activation(potential)
            pieces += [activation > 0.0, activation < 1.0]
        return np.concatenate(pieces, axis=1)

    def alarm(self) -> str | None:
        """Returns a sentence if a potential has left the range that currents and reversals can explain."""
        low, high = self._explicable_mV
        potential = self._state.potential[0]
        # Written so that NaN fails it.
        if np.minimum.reduce(potential) >= low and np.maximum.reduce(potential) <= high:
            return None
        worst = int(np.argmin((potential >= low) & (potential <= high)))
        return (
            f"potential of {self._stepper.arrays.neurons[worst]} is {potential[worst]:.4g} mV, outside "
            f"{low:g} .. {high:g} mV: the control timestep of {self._stepper.timestep_ms:g} ms is too long"
        )

    def _attrs(self) -> dict[str, float]:
        return {f"conductance_{name}_uS": value for name, value in asdict(self._parameters.conductances).items()}
