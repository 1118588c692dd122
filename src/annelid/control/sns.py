"""The paper's controller, and one that extends its network by a descending drive."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import asdict
from functools import cached_property
from itertools import pairwise
from typing import Any, Generic, Literal, TypeVar, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from annelid.config.kinds import Knob
from annelid.config.run import ControllerKind, RunConfig
from annelid.config.sections import NonNegative, Positive, Share
from annelid.config.settings import StretchSensor
from annelid.control.base import ControllerCode, HalfCentreKind, NeuralController, Slope, TimeConstant, design_of
from annelid.control.stretch_sensor import StretchSensor as StretchThreshold
from annelid.errors import ConfigError
from annelid.nervous import Network, NetworkState, PeristalsisParameters, Stepper, peristalsis
from annelid.protocols import Array, Plant, Sensation, State, Values

Config = TypeVar("Config", bound=ControllerKind)
DRIVE_HINT = "Descending drive: more of it makes the wave faster."


class Sns(HalfCentreKind):
    """The paper's synthetic nervous system: one half-centre per segment, gated by its neighbour's stretch."""

    sensor_fields = frozenset({"tolerance_m", "noise_m"})
    tuned = (
        "controller.gate_time_constant_ms=80:900:log",
        "controller.activation_slope_per_mV=0.1:2:log",
        "sensor.tolerance_m=0.001:0.03:log",
        "sensor.hysteresis_m=0:0.02",
    )
    kind: Literal["sns"] = "sns"
    bifurcation_mV: Positive = Field(
        default=0.01, description="delta: how far past the bifurcation the half-centre sits"
    )
    sensor_current_nA: NonNegative = Field(default=20.0, description="current of a stretch sensor that is on")
    kick_nA: NonNegative = Field(default=1.0, description="current into the first contraction neuron at the first step")
    activation: Literal["sigmoid", "linear"] = Field(
        default="sigmoid", description="Eq. 2, or the planar worm's clipped difference of the half-centre"
    )
    activation_slope_per_mV: Positive = Field(default=0.35, description="slope of the sigmoid")
    scheme: Literal["euler", "toolbox", "heun"] = Field(
        default="euler", description="forward Euler, SNS-Toolbox's order (gates before potentials), or second order"
    )
    gate_start: Literal["steady", "toolbox"] = Field(
        default="steady", description="gates start at h_inf(U), or as SNS-Toolbox starts them"
    )

    def build(self, config: RunConfig, plant: Plant) -> SnsController:
        """Builds the controller, as `ControllerKind.build`."""
        return SnsController(self, config.sensor, plant.n_segments, plant.n_muscles, config.clock.control_timestep_s)

    def cited(self) -> tuple[tuple[str, str], ...]:
        """Returns the network, and SNS-Toolbox where the steps are in its order."""
        network = ("riddle2022", "the network"), ("szczecinski2017", "the rules by which synapses are designed")
        toolbox = ("nourse2023", "how the gates start, or the order of their steps")
        return (*network, toolbox) if "toolbox" in (self.scheme, self.gate_start) else network


def paper_controller(controller: ControllerKind) -> Sns | None:
    """Returns a controller's section if it is the paper's network and nothing else, else None."""
    return controller if isinstance(controller, Sns) else None


class PeristalsisController(NeuralController, Generic[Config]):
    """A controller of the paper's network, or of one that extends it, gated by stretch sensors.

    One step, from t to t + dt: the lengths sensed at t switch the sensors, whose currents act on the network
    during the whole step; the activation is read from the potentials at t + dt and drives the body from t on.
    This is the order of the authors' loop. The kick acts during the first step only.

    Raises:
        ConfigError: Fewer than 3 segments, muscles that are neither one nor two per segment, network parameters for
            which a design rule has no solution, or a control step beyond a neuron's time constant.
    """

    _SENSOR_ON = "stretch sensor during the last control step: 1 while the segment is at rest length"
    recorded = (*NeuralController.recorded, ("sensor_on", ("segment",), "1", _SENSOR_ON))
    _every_step_differs = False

    def __init__(
        self, config: Config, sensor: StretchSensor, n_segments: int, n_muscles: int, control_timestep_s: float
    ) -> None:
        """Builds the controller in its initial state.

        Args:
            config: Its section of the configuration, which is that of the paper's network or has it as ``network``.
            sensor: Section of the stretch sensors; the simulation adds their noise, which is not used here.
            n_segments: Segments, at least 3.
            n_muscles: ``n_segments``, or twice that for half-rings (left, right, segment by segment).
            control_timestep_s: Step of the network, s.
        """
        self._config = config
        self._sns = sns = cast(Sns, getattr(config, "network", config))
        self._parameters = design_of(PeristalsisParameters, sns)
        self._range_mV, self._full_nA = sns.range_mV, sns.leak_conductance_uS * sns.range_mV
        self._timestep_s = control_timestep_s
        self._sensor = StretchThreshold(sensor, n_segments)
        super().__init__(
            self._network(n_segments),
            peristalsis.ROLES,
            n_segments,
            n_muscles,
            control_timestep_s,
            scheme=sns.scheme,
            slope_per_mV=sns.activation_slope_per_mV,
            linear_range_mV=sns.range_mV if sns.activation == "linear" else None,
        )

    @abstractmethod
    def _network(self, n_segments: int) -> Network:
        """Returns the paper's network, with any further neurons and inputs behind its own."""

    def _time_constant_s(self, field: str) -> float:
        """A time constant of the section, refused if it is shorter than the control step."""
        value = float(getattr(self._config, field))
        if not self._timestep_s <= value:
            raise ConfigError(
                f"controller.{field} = {value:g}: must be at least {self._timestep_s:g}, the control timestep"
            )
        return value

    def _set_further(
        self, inputs_nA: Array, sensation: Sensation, longer_m: Array, time_s: float, n_taken: int
    ) -> None:
        """Writes the currents of the inputs behind those of the sensors and the kick.

        Given are what is sensed, the segments' lengthening, m, at a time, s, and the number of steps taken by then.
        """

    def reset(self, seed: int) -> None:
        """Returns to the initial state: segment 1 contracted, the others expanded; nothing here is random."""
        off = np.zeros(self._n_segments, dtype=bool)
        self._start_at(self._stepper.initial_state(self._sns.gate_start), sensor_on=off, n_steps=np.array(0))

    def stride(self, sensation: Sensation, n_steps: int) -> Array:
        """Advances by control steps, as `annelid.protocols.StridingController.stride`."""
        pieces = self._inputs(self._now, sensation, n_steps)
        return self._activation(np.concatenate([self._advance(inputs_nA, n) for n, inputs_nA in pieces]))

    def _inputs(self, now: dict[str, NDArray[Any]], sensation: Sensation, n_steps: int) -> Iterator[tuple[int, Array]]:
        """Yields numbers of steps and the inputs' currents during them, nA, for one network or many copies.

        Replaces ``sensor_on`` and ``n_steps`` of the state. All arrays of copies have one more axis in front.
        """
        n_segments, shape, taken = self._n_segments, (len(self._stepper.arrays.inputs),), int(now["n_steps"])
        first = round(sensation.time_s / self._timestep_s)
        times_s = [sensation.time_s, *((first + k) * self._timestep_s for k in range(1, n_steps))]
        longer = self._lengthening(sensation, n_steps)
        on = self._sensor.readings(now["sensor_on"], longer, times_s)
        changes = np.any(on[1:] != on[:-1], axis=tuple(range(1, on.ndim)))
        cuts = {0, n_steps, *(np.flatnonzero(changes) + 1).tolist()}
        cuts |= set(range(n_steps)) if self._every_step_differs else {1} if taken == 0 else set()
        for start, end in pairwise(sorted(cuts)):
            inputs_nA = np.zeros(on.shape[1:-1] + shape)
            inputs_nA[..., :n_segments] = self._sns.sensor_current_nA * on[start]
            inputs_nA[..., n_segments] = self._sns.kick_nA if taken + start == 0 else 0.0
            further = inputs_nA[..., n_segments + 1 :]
            self._set_further(further, sensation, longer[start], times_s[start], taken + start)
            yield end - start, inputs_nA
        now["sensor_on"], now["n_steps"] = on[-1], np.array(taken + n_steps)

    def _values(self) -> Values:
        return {**super()._values(), "sensor_on": self._now["sensor_on"].astype(np.float64)}

    def code(self) -> ControllerCode:
        """Returns what it does as C, as `annelid.control.base.Coded.code`."""
        further = self._further_code()
        inputs = """
    for (i = 0; i < N_SEGMENTS; i++) {
        now.sensor_on[i] = sensors->lengthening_m[i] <= tolerance_m + hysteresis_m * now.sensor_on[i];
        if (i == 0 && now.n_steps < hold_steps) now.sensor_on[i] = 0;
        input_nA[i] = sensor_current_nA * now.sensor_on[i];
    }
    input_nA[N_SEGMENTS] = now.n_steps == 0 ? kick_nA : 0;"""
        # The first step at which segment 1 is released.
        hold_steps = max(round(self._sensor.settings.startup_hold_s / self._timestep_s) - 1, 0)
        while self._sensor.held_at(hold_steps * self._timestep_s):
            hold_steps += 1
        return self._code(
            senses=("lengthening_m", *further.get("senses", ())),
            inputs=inputs + further.get("inputs", ""),
            constants={
                "tolerance_m": self._sensor.settings.tolerance_m,
                "hysteresis_m": self._sensor.settings.hysteresis_m,
                "sensor_current_nA": self._sns.sensor_current_nA,
                "kick_nA": self._sns.kick_nA,
                "hold_steps": hold_steps,
                **further.get("constants", {}),
            },
            state={"sensor_on": np.zeros(self._n_segments)},
        )

    def _further_code(self) -> dict[str, Any]:
        """What `_set_further` does as C, with its senses and constants."""
        return {}


class SnsController(PeristalsisController[Sns]):
    """Drives a worm by the synthetic nervous system of Riddle et al. 2022 and 2023, as `PeristalsisController` does.

    A segment's activation is that of `annelid.control.base.NeuralController`: ``"sigmoid"`` as in Riddle et al. 2023,
    ``"linear"`` as in Riddle et al. 2022. Copies of it can be advanced at once, as a search for a limit cycle does.

    Raises:
        ConfigError: As `PeristalsisController`.
    """

    name = "synthetic nervous system"

    @cached_property
    def _copies(self) -> dict[int, tuple[Stepper, NetworkState]]:
        return {}

    def _network(self, n_segments: int) -> Network:
        return peristalsis.peristalsis_network(n_segments, self._parameters)

    def step_copies(self, states: State, sensation: Sensation) -> tuple[State, Array]:
        """Advances many copies by one control step, each as `step` does one, bit for bit; changes nothing here.

        Args:
            states: As `get_state` returns them, the arrays but for the number of steps with one more axis in
                front, ``n_copies`` long.
            sensation: Lengths with the same axis in front, ``(n_copies, n_segments, n_sensors)``; one time for all.

        Returns:
            The states one step on, and the activation, ``(n_copies, n_muscles)``.
        """
        switches: dict[str, Any] = {"sensor_on": states["sensor_on"].astype(bool), "n_steps": states["n_steps"]}
        n_copies = len(switches["sensor_on"])
        # Few widths of buffers serve any number of copies.
        width = 1 << (n_copies - 1).bit_length()
        if width not in self._copies:
            own = self._stepper
            stepper = Stepper(own.arrays, own.timestep_ms, own.scheme, width)
            self._copies[width] = stepper, stepper.initial_state(self._sns.gate_start)
        stepper, copies = self._copies[width]
        copies.potential[:n_copies] = states["potential"][:, 0]
        copies.gate[:n_copies] = states["gate"][:, 0]
        of_all = np.zeros((width, self._n_segments + 1))
        ((_, of_all[:n_copies]),) = self._inputs(switches, sensation, 1)
        stepper.advance(copies, of_all)
        potential, gate = copies.potential[:n_copies].copy(), copies.gate[:n_copies].copy()
        after: State = {"potential": potential[:, np.newaxis], "gate": gate[:, np.newaxis], **switches}
        return after, self._activation(potential)

    def pieces_copies(self, states: State) -> NDArray[np.bool_]:
        """Finds in which piece of its piecewise smooth equations each of many copies is.

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
        sns, potential = self._sns, self._state.potential[0]
        drive = (sns.sensor_current_nA + sns.kick_nA) / sns.leak_conductance_uS
        low = sns.inhibitory_reversal_mV - drive
        high = max(sns.excitatory_reversal_mV, sns.sodium_reversal_mV) + drive
        # Written so that NaN fails it.
        if np.minimum.reduce(potential) >= low and np.maximum.reduce(potential) <= high:
            return None
        worst = int(np.argmin((potential >= low) & (potential <= high)))
        return (
            f"potential of {self._stepper.arrays.neurons[worst]} is {potential[worst]:.4g} mV, outside "
            f"{low:g} .. {high:g} mV: the control timestep of {self._stepper.timestep_ms:g} ms is too long"
        )

    def _attrs(self) -> dict[str, float | int | str]:
        return {f"conductance_{name}_uS": value for name, value in asdict(self._parameters.conductances).items()}


class AdaptiveSns(ControllerKind):
    """The synthetic nervous system with a descending neuron, whose activity sets the rate of all half-centres.

    The wanted activity is ``drive + drive_slope_per_s time + stretch_gain_per_m stretch``, clipped to 0 .. 1, with the
    mean lengthening of all segments as stretch: a manual, a timed and a sensory drive. The descending neuron follows it
    with its time constant.
    """

    sensor_fields = Sns.sensor_fields
    tuned = (
        "controller.drive=0:1",
        "controller.network.gate_time_constant_ms=80:900:log",
        "sensor.tolerance_m=0.001:0.03:log",
        "sensor.hysteresis_m=0:0.02",
    )
    kind: Literal["adaptive"] = "adaptive"
    network: Sns = Sns()
    drive: Share = Field(default=0.0, description="0: the half-centres' slow rhythm; 1: about three times as fast")
    drive_slope_per_s: Slope = Field(default=0.0, description="change of the manual drive")
    stretch_gain_per_m: float = Field(
        default=0.0, ge=-1000, le=1000, description="drive per mean lengthening of the segments"
    )
    drive_time_constant_s: TimeConstant = Field(default=0.05, description="of the descending neuron")

    def build(self, config: RunConfig, plant: Plant) -> AdaptiveController:
        """Builds the controller, as `ControllerKind.build`."""
        size = plant.n_segments, plant.n_muscles
        return AdaptiveController(self, config.sensor, *size, config.clock.control_timestep_s)

    def cited(self) -> tuple[tuple[str, str], ...]:
        """Returns what the network rests on, and its drive."""
        return (*self.network.cited(), ("nourse", "the idea of half-centres that adapt their rate"))

    def knobs(self) -> tuple[Knob, ...]:
        """Returns the manual drive."""
        return (Knob("controller.drive", "drive", 1.0, 0.0, 1.0, 0.01, DRIVE_HINT),)


class AdaptiveController(PeristalsisController[AdaptiveSns]):
    """Drives a worm by the peristalsis network with a descending neuron that sets the rate of its half-centres.

    It starts with that neuron silent. The rest, errors too, is as for `annelid.control.SnsController`.
    """

    name = "synthetic nervous system with a descending drive"
    recorded = (*PeristalsisController.recorded, ("drive", (), "1", "activity of the descending neuron"))

    def _network(self, n_segments: int) -> Network:
        self._every_step_differs = self._config.drive_slope_per_s != 0.0 or self._config.stretch_gain_per_m != 0.0
        tau_ms = 1e3 * self._time_constant_s("drive_time_constant_s")
        return peristalsis.adaptive_peristalsis_network(n_segments, self._parameters, tau_ms)

    def _set_further(
        self, inputs_nA: Array, sensation: Sensation, longer_m: Array, time_s: float, n_taken: int
    ) -> None:
        manual = self._config.drive + self._config.drive_slope_per_s * n_taken * self._timestep_s
        drive = manual + self._config.stretch_gain_per_m * float(longer_m.mean())
        leak, reach = self._parameters.leak_conductance_uS, self._parameters.range_mV
        inputs_nA[...] = min(max(drive, 0.0), 1.0) * leak * reach

    def _further_code(self) -> dict[str, Any]:
        p, config = self._parameters, self._config
        inputs = """
    {
        real sum_m = 0;
        for (i = 0; i < N_SEGMENTS; i++) sum_m += sensors->lengthening_m[i];
        input_nA[N_SEGMENTS + 1] = clipped(
            drive_at_start + drive_slope_per_s * (real)now.n_steps * timestep_s
            + stretch_gain_per_m * (sum_m / N_SEGMENTS), 0, 1) * leak_uS * range_mV;
    }"""
        constants = {
            "drive_at_start": config.drive,
            "drive_slope_per_s": config.drive_slope_per_s,
            "stretch_gain_per_m": config.stretch_gain_per_m,
            "timestep_s": self._timestep_s,
            "leak_uS": p.leak_conductance_uS,
            "range_mV": p.range_mV,
        }
        return {"inputs": inputs, "constants": constants}

    def _values(self) -> Values:
        return {**super()._values(), "drive": self._activity(peristalsis.DRIVE_NEURON)}

    def _attrs(self) -> dict[str, float | int | str]:
        return {"conductance_drive_uS": peristalsis.drive_conductance_uS(self._parameters)}
