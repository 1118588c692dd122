"""A controller, declared: a network, what sets the currents of its inputs, and which of its outputs drive the muscles.

Two things read a `Circuit`, and nothing else is written for a controller: `annelid.control.CircuitController` steps it
with numpy, and `annelid_lab.firmware.controller_firmware` writes it as C99.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from annelid.clock import SLACK_S
from annelid.control.senses import SENSED, Pulse, Sense, Source, Switch
from annelid.errors import ConfigError, require_at_least, shown, suggest
from annelid.nervous import GateStart, Network, Scheme
from annelid.protocols import Array


@dataclass(frozen=True, slots=True)
class Readout:
    """How outputs of a network become the activation of segments.

    The activation goes by the potential of an output, or by the difference of two: along a line, from 0 at
    ``from_mV`` to 1 at ``to_mV``, or by the sigmoid ``1 / (1 + exp(-slope_per_mV U))``.

    Attributes:
        contracting: The output of each segment.
        expanding: The output of each segment that is taken off; none is.
        from_mV: Potential of activation 0.
        to_mV: Potential of activation 1.
        slope_per_mV: Slope of the sigmoid, which then takes the place of the line.

    Raises:
        ConfigError: ``to_mV`` equal to ``from_mV``, or another number of outputs that are taken off.
    """

    contracting: Sequence[str]
    expanding: Sequence[str] = ()
    from_mV: float = 0.0
    to_mV: float = 20.0
    slope_per_mV: float | None = None

    def __post_init__(self) -> None:
        if self.from_mV == self.to_mV:
            raise ConfigError(f"to_mV must differ from from_mV, both are {self.to_mV:g}")
        if self.expanding and len(self.expanding) != len(self.contracting):
            raise ConfigError(
                f"{len(self.expanding)} outputs expand and {len(self.contracting)} contract: each segment needs one of "
                "both, or all segments one alone"
            )

    @property
    def line(self) -> tuple[float, float, float, float]:
        """Least and greatest potential of the line, mV, its length, mV, and what is added: ``clip(U) / length + d``."""
        length = self.to_mV - self.from_mV
        return min(self.from_mV, self.to_mV), max(self.from_mV, self.to_mV), length, -self.from_mV / length


@dataclass(frozen=True)
class Circuit:
    """A controller by its parts.

    Attributes:
        network: The network; it is not changed.
        inputs: What sets the currents of its inputs, by their names; those that are not named get none.
        readout: Which of its outputs drive the muscles.
        scheme: As of `annelid.nervous.Network.compile`.
        gate_start: As of `annelid.nervous.Stepper.initial_state`.
        name: What the run file calls the controller.
        random_start_mV: Bounds between which a reset draws all potentials by its seed, and gates between 0 and 1.
        activities: Neurons whose activity, the potential over ``range_mV``, is recorded, by the name of the signal.
        range_mV: Potential of activity 1.
        constants: Numbers worth an attribute of the run file.

    Raises:
        ConfigError: The network has no such input or output.
    """

    network: Network
    inputs: Mapping[str, Source]
    readout: Readout
    scheme: Scheme = "euler"
    gate_start: GateStart = "steady"
    name: str = "network"
    random_start_mV: tuple[float, float] | None = None
    activities: Mapping[str, Sequence[str]] = field(default_factory=dict)
    range_mV: float = 20.0
    constants: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for names, known, what in (
            (self.inputs, self.network.inputs, "input"),
            ((*self.readout.contracting, *self.readout.expanding), self.network.outputs, "output"),
        ):
            for name in names:
                if name not in known:
                    raise ConfigError(f"the network has no {what} {shown(name)}: {suggest(name, known)}")
        require_at_least(1, outputs=len(self.readout.contracting))

    @property
    def n_segments(self) -> int:
        """Segments that it drives."""
        return len(self.readout.contracting)

    @property
    def senses(self) -> tuple[str, ...]:
        """What it senses, names in `SENSED`."""
        used = {source.quantity for source in self.inputs.values() if isinstance(source, Sense | Switch)}
        return tuple(name for name in SENSED if name in used)

    def places(self, outputs: Sequence[str]) -> NDArray[np.intp]:
        """Returns the places of outputs' neurons among all neurons."""
        neurons = list(self.network.neurons)
        return np.array([neurons.index(self.network.outputs[name]) for name in outputs], dtype=np.intp)


class InputTable:
    """The currents of a circuit's inputs as a table: a row for each input that is set, first the linear ones.

    What is sensed is one list of numbers, quantity by quantity, with a 0 behind it.

    Attributes:
        n_inputs: Inputs of the network.
        n_linear: Linear rows: senses, constants and pulses. Those behind them are switches.
        input: Place of each row's input, ``(n_rows,)``.
        place: Places of what each row senses, filled up with that of the 0, ``(n_rows, most)``.
        gain: nA, as `threshold`, `span`, `least` and `most` of shape ``(n_rows,)``.
        hysteresis: Of the switches, ``(n_rows - n_linear,)``.
        first: Control step from which each row acts, ``(n_rows,)``.
        end: Control step from which it does not any more, 0 for always, ``(n_rows,)``.
        functions: Inputs that are set by a function of Python, with their places.

    Raises:
        ConfigError: A place that the body of so many segments has not.
    """

    def __init__(self, circuit: Circuit, timestep_s: float) -> None:
        names = list(circuit.network.inputs)
        sources = [(names.index(name), source) for name, source in circuit.inputs.items()]
        self.functions = [(place, source) for place, source in sources if callable(source)]
        rows = [(place, source) for place, source in sources if not callable(source)]
        # Switches, which have a state, behind all others.
        rows.sort(key=lambda row: isinstance(row[1], Switch))
        shapes = {name: SENSED[name].shape(circuit.n_segments) for name in circuit.senses}
        n_values = sum(math.prod(shape) for shape in shapes.values())
        self.n_inputs, self.n_linear = len(names), sum(not isinstance(source, Switch) for _, source in rows)
        self.input = np.array([place for place, _ in rows], dtype=np.intp)
        found = [_places(source, shapes) for _, source in rows]
        self.place = np.full((len(rows), max(map(len, found), default=1) or 1), n_values)
        for row, places in enumerate(found):
            self.place[row, : len(places)] = places
        numbers = np.array([_numbers(source) for _, source in rows]).reshape(-1, 8)
        self.gain, self.threshold, self.span, self.least, self.most, hysteresis, from_s, until_s = numbers.T
        self.hysteresis = hysteresis[self.n_linear :]
        self.first = np.array([_first_step(time_s, timestep_s) for time_s in from_s], dtype=np.int64)
        # A pulse of no length begins when it has ended.
        ends = [0 if time_s == np.inf else max(_first_step(time_s, timestep_s), 1) for time_s in until_s]
        self.end = np.array(ends, dtype=np.int64)
        self.first[until_s == 0.0] = 1
        self._settled = int(max(self.first.max(initial=0), self.end.max(initial=0)))
        self._lasting = np.flatnonzero(self.end[: self.n_linear] == 0)
        self._switches = np.arange(self.n_linear, len(rows))

    def currents(self, sensed: Array, first_step: int, on: NDArray[np.bool_]) -> tuple[Array, NDArray[np.bool_]]:
        """Returns the inputs' currents at control steps, nA.

        Args:
            sensed: What is sensed at each step, ``(n_steps, n_values + 1)``.
            first_step: Number of the first step.
            on: Which switches were on at the step before, ``(n_switches,)``.

        Returns:
            Currents, ``(n_steps, n_inputs)``, and which switches are on at the last step, ``(n_switches,)``.
        """
        inputs_nA = np.zeros((len(sensed), self.n_inputs))
        acting = None
        if first_step < self._settled:
            at = np.arange(first_step, first_step + len(sensed))[:, np.newaxis]
            acting = (self.first <= at) & ((self.end == 0) | (at < self.end))
        linear = self._lasting if acting is None else np.arange(self.n_linear)
        if linear.size:
            values = self._added(sensed, linear)
            rising = self.gain[linear] * ((values - self.threshold[linear]) / self.span[linear])
            rising = np.minimum(np.maximum(rising, self.least[linear]), self.most[linear])
            inputs_nA[..., self.input[linear]] = (
                rising if acting is None else np.where(acting[..., linear], rising, 0.0)
            )
        if self.hysteresis.size:
            switches = self._switches
            values, threshold = self._added(sensed, switches), self.threshold[switches]
            may = np.array(True) if acting is None else acting[..., switches]
            if self.hysteresis.any():
                now_on = np.empty(values.shape, dtype=bool)
                for step, may_now in enumerate(np.broadcast_to(may, values.shape)):
                    now_on[step] = on = (values[step] <= threshold + self.hysteresis * on) & may_now
            else:
                now_on = (values <= threshold) & may
            inputs_nA[..., self.input[switches]] = self.gain[switches] * now_on
            on = now_on[-1]
        return inputs_nA, on

    def _added(self, sensed: Array, rows: NDArray[np.intp]) -> Array:
        """The sums of what rows sense, ``(n_steps, n_rows)``."""
        if self.place.shape[1] == 1:
            return sensed.take(self.place[rows, 0], axis=-1)
        return sensed[..., self.place[rows]].sum(axis=-1)


def _places(source: Sense | Switch | Pulse | float, shapes: Mapping[str, tuple[int, ...]]) -> list[int]:
    """Places of what a source senses, in the list of all numbers that are sensed."""
    if not isinstance(source, Sense | Switch):
        return []
    names = list(shapes)
    start = sum(math.prod(shapes[name]) for name in names[: names.index(source.quantity)])
    shape = shapes[source.quantity]
    try:
        found = np.arange(start, start + math.prod(shape)).reshape(shape)[source.place]
    except IndexError:
        raise ConfigError(f"the body senses no {source.quantity} at {source.place}") from None
    return np.ravel(found).tolist()


def _numbers(source: Sense | Switch | Pulse | float) -> tuple[float, ...]:
    """Gain, threshold, span, bounds, hysteresis and times of a row; a constant is a sense of nothing."""
    if isinstance(source, Sense):
        return source.gain, source.threshold, source.span, source.least_nA, source.most_nA, 0.0, source.from_s, np.inf
    if isinstance(source, Switch):
        return source.current_nA, source.threshold, 1.0, 0.0, 0.0, source.hysteresis, source.from_s, np.inf
    current, until_s = (source.current_nA, source.until_s) if isinstance(source, Pulse) else (float(source), np.inf)
    return 0.0, 0.0, 1.0, current, current, 0.0, 0.0, until_s


def _first_step(time_s: float, timestep_s: float) -> int:
    """The first control step that is not before a time."""
    step = max(round(time_s / timestep_s) - 1, 0)
    while step * timestep_s < time_s - SLACK_S:
        step += 1
    return step
