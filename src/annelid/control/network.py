"""A user's own network as a controller: what its inputs sense, and which of its outputs drive the muscles."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from annelid.control.base import SENSED, ControllerCode, NeuralController
from annelid.errors import ConfigError, require_positive, shown, suggest
from annelid.nervous import GapJunction, Network, Scheme
from annelid.nervous.arrays import NO_GATE
from annelid.protocols import Array, Sensation, Values
from annelid.text import numbered

LONGEST_TEXT = 60_000
"""Characters of a network that a run file's attribute can hold."""


@dataclass(frozen=True, slots=True)
class Sense:
    """A current that rises linearly with something that the body senses: ``gain (value - threshold)``, within bounds.

    Attributes:
        quantity: ``"lengthening_m"``, ``"touch_N"``, ``"heading_rad"`` or ``"front_m"``.
        place: Which of its numbers: the segment, counted from 0, and for touch also the side, as in
            `annelid.protocols.SIDES`.
        gain: nA per unit of the quantity.
        threshold: Value at which the current is 0.
        least_nA: Smallest current.
        most_nA: Largest current.

    Raises:
        ConfigError: An unknown quantity, or bounds in the wrong order.
    """

    quantity: str
    place: int | tuple[int, ...]
    gain: float
    threshold: float = 0.0
    least_nA: float = 0.0
    most_nA: float = float("inf")

    def __post_init__(self) -> None:
        if self.quantity not in SENSED:
            raise ConfigError(f"unknown quantity {shown(self.quantity)}: {suggest(self.quantity, SENSED)}")
        if not self.least_nA <= self.most_nA:
            raise ConfigError(f"least_nA = {self.least_nA:g} must be at most most_nA = {self.most_nA:g}")

    def current_nA(self, sensed: Array) -> float:
        """Returns the current for the values of the quantity.

        Raises:
            ConfigError: The body does not sense it there.
        """
        try:
            value = float(sensed[self.place])
        except IndexError:
            raise ConfigError(f"the body senses no {self.quantity} at {self.place}") from None
        return min(max(self.gain * (value - self.threshold), self.least_nA), self.most_nA)


Input: TypeAlias = Sense | float | Callable[[Sensation], float]
"""What sets the current of an input, nA: something sensed, a constant, or any function of the sensation."""
Output: TypeAlias = str | tuple[str, str]
"""An output of the network, or two, of which the first contracts and the second expands."""


class NetworkController(NeuralController):
    """Drives a worm by a network of a user's own.

    One step, from t to t + dt: what is sensed at t sets the currents of the inputs during the whole step, and the
    activation is read from the potentials at t + dt. For each segment it goes by an output's potential, or by the
    difference of two: linearly, from 0 at ``from_mV`` to 1 at ``to_mV``, or by the sigmoid
    ``1 / (1 + exp(-slope_per_mV U))``. Recorded are all potentials, slow gates and currents of connections, by name.

    Example::

        inputs = {f"stretch_{i + 1}": Sense("lengthening_m", i, gain=400.0) for i in range(3)}
        controller = NetworkController(network, inputs, outputs=["motor_1", "motor_2", "motor_3"])
        annelid.simulate("riddle2023-rods", "runs/mine", controller=controller)

    Raises:
        ConfigError: The network has no such input or output, muscles that are neither one nor two per segment, or
            ``to_mV`` equal to ``from_mV``.
    """

    name = "network"
    recorded = (
        ("potential", ("neuron",), "mV", "membrane potential"),
        ("gate", ("channel",), "1", "slow gate of a channel"),
        ("synaptic_current", ("connection",), "nA", "current through a synapse or gap junction into its target"),
    )

    def __init__(
        self,
        network: Network,
        inputs: Mapping[str, Input],
        outputs: Sequence[Output],
        *,
        n_muscles: int | None = None,
        control_timestep_s: float = 0.001,
        scheme: Scheme = "euler",
        from_mV: float = 0.0,
        to_mV: float = 20.0,
        slope_per_mV: float | None = None,
    ) -> None:
        """Compiles the network.

        Args:
            network: The network; it is not changed.
            inputs: What sets the currents of its inputs; those that are not named get none.
            outputs: For every segment the output that drives its muscles, or two.
            n_muscles: Muscles; default one per segment. Half-rings are two, which are driven alike.
            control_timestep_s: Step of the network, s: ``clock.control_timestep_s`` of the run.
            scheme: As of `annelid.nervous.Network.compile`.
            from_mV: Potential of activation 0.
            to_mV: Potential of activation 1.
            slope_per_mV: Slope of the sigmoid, which then takes the place of the line.
        """
        for name in inputs:
            if name not in network.inputs:
                raise ConfigError(f"the network has no input {shown(name)}: {suggest(name, network.inputs)}")
        pairs = [(output, None) if isinstance(output, str) else output for output in outputs]
        for name in (each for pair in pairs for each in pair if each is not None):
            if name not in network.outputs:
                raise ConfigError(f"the network has no output {shown(name)}: {suggest(name, network.outputs)}")
        if from_mV == to_mV:
            raise ConfigError(f"to_mV must differ from from_mV, both are {to_mV:g}")
        require_positive(control_timestep_s=control_timestep_s)
        self._rules = {place: inputs[name] for place, name in enumerate(network.inputs) if name in inputs}
        self._senses = {rule.quantity for rule in self._rules.values() if isinstance(rule, Sense)}
        self._from_mV, self._to_mV, self._is_linear = from_mV, to_mV, slope_per_mV is None
        place = {name: number for number, name in enumerate(network.neurons)}
        self._ends = [[None if end is None else place[network.outputs[end]] for end in pair] for pair in pairs]
        self._currents = _Currents(network)
        super().__init__(
            network,
            (),
            len(pairs),
            len(pairs) if n_muscles is None else n_muscles,
            control_timestep_s,
            scheme=scheme,
            slope_per_mV=slope_per_mV or 0.0,
        )
        gates = self._stepper.arrays.gates[: self._stepper.arrays.n_slow]
        self._gates = [(slot, c) for slot, row in enumerate(gates) for c, gate in enumerate(row) if gate != NO_GATE]

    def reset(self, seed: int) -> None:
        """Returns to the network's initial state; nothing here is random."""
        state = self._stepper.initial_state()
        self._start_at(state, n_steps=np.array(0))

    def stride(self, sensation: Sensation, n_steps: int) -> Array:
        """Advances by control steps, as `annelid.protocols.StridingController.stride`.

        Raises:
            ConfigError: The run has another control step, or the body does not sense what an input needs.
        """
        taken, own_s = int(self._now["n_steps"]), self._timestep_s
        if abs(sensation.time_s - taken * own_s) > 0.5 * own_s:
            raise ConfigError(
                f"control_timestep_s = {own_s:g} of the NetworkController must be clock.control_timestep_s of the run"
            )
        changes = any(callable(rule) for rule in self._rules.values())
        changes = changes or ("lengthening_m" in self._senses and sensation.stretch_rate_m_per_s.any())
        potentials = []
        for done in range(n_steps if changes else 1):
            at = sensation if done == 0 else sensation.later((taken + done) * own_s)
            potentials.append(self._advance(self._inputs_nA(at), 1 if changes else n_steps))
        self._now["n_steps"][...] = taken + n_steps
        return self._activation(np.concatenate(potentials))

    def _inputs_nA(self, sensation: Sensation) -> Array:
        sensed = {quantity: SENSED[quantity].read(sensation) for quantity in self._senses}
        inputs_nA = np.zeros(len(self._stepper.arrays.inputs))
        for place, rule in self._rules.items():
            if isinstance(rule, Sense):
                inputs_nA[place] = rule.current_nA(sensed[rule.quantity])
            else:
                inputs_nA[place] = rule(sensation) if callable(rule) else rule
        return inputs_nA

    def _difference(self, potential: Array) -> Array:
        ends = (potential[..., up] - (0.0 if down is None else potential[..., down]) for up, down in self._ends)
        return np.stack(list(ends), axis=-1)

    def _shares(self, potential: Array) -> Array:
        if not self._is_linear:
            return super()._shares(potential)
        return np.clip((self._difference(potential) - self._from_mV) / (self._to_mV - self._from_mV), 0.0, 1.0)

    def code(self) -> ControllerCode:
        """Returns what it does as C, as `annelid.control.base.Coded.code`.

        Raises:
            ConfigError: An input is set by a function of Python.
        """
        names, statements = list(self.network.inputs), []
        for place, rule in self._rules.items():
            if callable(rule):
                raise ConfigError(
                    f"input {shown(names[place])} is set by a function of Python, which is not written as C"
                )
            if isinstance(rule, Sense):
                places = rule.place if isinstance(rule.place, tuple) else (rule.place,)
                value = f"sensors->{rule.quantity}" + "".join(f"[{number}]" for number in places)
                row = f"sense[{len(statements)}]"
                current = f"clipped({row}[0] * ({value} - {row}[1]), {row}[2], {row}[3])"
            else:
                current = f"sense[{len(statements)}][0]"
            statements.append(f"    input_nA[{place}] = {current};")
        rows = [
            [r.gain, r.threshold, r.least_nA, r.most_nA] if isinstance(r, Sense) else [float(r), 0.0, 0.0, 0.0]
            for r in self._rules.values()
            if not callable(r)
        ]
        return self._code(
            senses=tuple(sorted(self._senses)),
            inputs="\n".join(statements),
            constants={"sense": np.array(rows)} if rows else {},
        )

    def _difference_code(self) -> tuple[str, dict[str, Array]]:
        down = [end for _, end in self._ends]
        if all(end is None for end in down):
            return "now.potential_mV[up[i]]", {"up": np.array([end for end, _ in self._ends])}
        if None in down:
            raise ConfigError("outputs of which some are one and some are two are not written as C")
        return "(now.potential_mV[up[i]] - now.potential_mV[down[i]])", dict(
            zip(("up", "down"), np.array(self._ends).T, strict=True)
        )

    def _share_code(self) -> tuple[str, dict[str, float | Array]]:
        if not self._is_linear:
            return super()._share_code()
        value, constants = self._difference_code()
        numbers = {"from_mV": self._from_mV, "activation_range_mV": self._to_mV - self._from_mV}
        return f"clipped(({value} - from_mV) / activation_range_mV, 0, 1)", {**constants, **numbers}

    def _values(self) -> Values:
        state = self._state
        values = {"potential": state.potential[0].copy()}
        if self._gates:
            values["gate"] = np.array([state.gate[0, slot, channel] for slot, channel in self._gates])
        if self._currents.labels:
            values["synaptic_current"] = self._currents.read(state.potential[0])
        return values

    def _coords(self) -> dict[str, list[int] | list[str]]:
        arrays = self._stepper.arrays
        bearers = [arrays.neurons[arrays.channel_neuron[channel]] for _, channel in self._gates]
        labels = {"channel": numbered(bearers), "connection": self._currents.labels}
        return {**super()._coords(), **{name: each for name, each in labels.items() if each}}

    def _attrs(self) -> dict[str, float | int | str]:
        text = self.network.to_toml()
        return {"network": text} if len(text) <= LONGEST_TEXT else {}


class _Currents:
    """The currents of all connections, from potentials."""

    def __init__(self, network: Network) -> None:
        place = {name: number for number, name in enumerate(network.neurons)}
        self.labels = numbered(f"{c.source} -> {c.target}" for c in network.connections)
        self._source = np.array([place[c.source] for c in network.connections], dtype=np.intp)
        self._target = np.array([place[c.target] for c in network.connections], dtype=np.intp)
        kinds = [c.kind for c in network.connections]
        self._conductance = np.array([kind.conductance_uS for kind in kinds])
        self._reversal = np.array([getattr(kind, "reversal_mV", np.nan) for kind in kinds])
        self._threshold = np.array([getattr(kind, "threshold_mV", 0.0) for kind in kinds])
        self._slope = 1.0 / (np.array([getattr(kind, "saturation_mV", 1.0) for kind in kinds]) - self._threshold)
        self._junction = np.array([isinstance(kind, GapJunction) for kind in kinds], dtype=bool)
        self._rectified = np.array([getattr(kind, "rectified", False) for kind in kinds], dtype=bool)

    def read(self, potential: Array) -> Array:
        """Returns the current of each into its target, nA."""
        before, after = potential[self._source], potential[self._target]
        opening = np.clip((before - self._threshold) * self._slope, 0.0, 1.0)
        flow = np.where(self._rectified, np.maximum(before - after, 0.0), before - after)
        return self._conductance * np.where(self._junction, flow, opening * (self._reversal - after))
