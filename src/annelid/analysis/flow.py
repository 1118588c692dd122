"""A closed loop of plant and controller as an autonomous map of one vector: what its limit cycle is sought with."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol, cast, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from annelid.errors import ConfigError
from annelid.protocols import Array, Controller, Plant, Records, Sensation, State, Stateful

Switches = NDArray[np.bool_]

MOST_STATES = 400
"""Continuous states beyond which a monodromy by finite differences is refused."""


class Flow(Protocol):
    """An autonomous system with continuous states and switches, advanced in fixed steps, many copies at once.

    A step reads the switches from the state at its beginning (and from what they were, for hysteresis) and
    advances under them; between two switchings the step is smooth.

    Attributes:
        timestep_s: Duration of a step, s.
        labels: Names of the continuous states.
        switch_labels: Names of the switches.
    """

    timestep_s: float
    labels: tuple[str, ...]
    switch_labels: tuple[str, ...]

    def step(self, state: Array, switches: Switches) -> tuple[Array, Switches]:
        """Advances copies by one step.

        Args:
            state: Shape ``(n_copies, n_states)``.
            switches: What they were during the step before, ``(n_copies, n_switches)``.

        Returns:
            The states one step on, and the switches in force during this step; new arrays.
        """
        ...

    def part(self, state: Array, switches: Switches, ahead: Array, share: Array) -> Array:
        """Takes shares of steps, up to the move of a switch or to the section.

        Args:
            state: Where the steps begin, ``(n_copies, n_states)``.
            switches: The switches in force, ``(n_copies, n_switches)``.
            ahead: What `step` returned for these.
            share: In [0, 1], ``(n_copies,)``.

        Returns:
            The states there; new.
        """
        ...


@runtime_checkable
class Senses(Protocol):
    """The capability of a plant of telling what it feels without moving."""

    def sense(self) -> Sensation:
        """Returns what the body feels at this instant."""
        ...


@runtime_checkable
class BatchedPlant(Protocol):
    """The capability of a plant of advancing many copies at once.

    States are as `Stateful.get_state` returns them, with one more axis in front, ``n_copies`` long, of every array
    of floats and booleans; integers, such as the number of steps taken, are shared by all copies.
    """

    def sense_copies(self, states: State) -> Sensation:
        """Returns what they feel: every array with the copies' axis in front, and one time for all."""
        ...

    def step_copies(self, states: State, activation: Array) -> State:
        """Returns their states one control step on, under activation ``(n_copies, n_muscles)``."""
        ...


@runtime_checkable
class BatchedController(Protocol):
    """The capability of a controller of advancing many copies at once; states are as for `BatchedPlant`."""

    def step_copies(self, states: State, sensation: Sensation) -> tuple[State, Array]:
        """Returns their states one control step on, and their activation ``(n_copies, n_muscles)``."""
        ...


@runtime_checkable
class Piecewise(Protocol):
    """The capability of a controller of telling where its equations have kinks; states are as for `BatchedPlant`."""

    def pieces_copies(self, states: State) -> Switches:
        """Returns in which smooth piece of the equations each copy is, ``(n_copies, n_pieces)``."""
        ...


@dataclass(frozen=True, slots=True)
class _Slot:
    """Where an array of a part's state lies in the vector of all."""

    name: str
    shape: tuple[int, ...]
    where: slice


class ClosedLoop:
    """Plant and controller as a `Flow`.

    The state is every array of floats in `get_state` of both, plant first; the switches are every array of booleans,
    so that a sensor's threshold is found without being told. Integers, such as the number of steps taken, are held at
    their values when this is made: what depends on them, a kick at the first step or a hold at the start, must be
    over by then.

    All copies advance in one call where plant and controller are batched (`BatchedPlant`, `BatchedController`).
    Otherwise each copy is restored, stepped and saved by itself: a period then costs one run per copy.

    Attributes:
        timestep_s: Duration of a step, s.
        labels: Names of the states: a neuron's name for a potential, else such as ``height[2]``.
        switch_labels: Names of the switches.
        batched: Whether all copies advance in one call.

    Raises:
        ConfigError: Plant or controller cannot be saved and restored, the plant cannot tell what it feels, there are
            more than `MOST_STATES` states, or the loop depends on time itself.
    """

    def __init__(
        self, plant: Plant, controller: Controller, control_timestep_s: float, stride: int = 1, *, kinks: bool = False
    ) -> None:
        """Takes plant and controller in their present state.

        Args:
            plant: The body; it is stepped by this from now on.
            controller: The controller, likewise.
            control_timestep_s: Duration of a control step, s.
            stride: Control steps a step, more than 1 where the body moves in coarser steps than the controller.
            kinks: Count kinks of the controller's equations among the switches, where it tells them (`Piecewise`).
        """
        for part, what in ((plant, "plant"), (controller, "controller")):
            if not isinstance(part, Stateful):
                raise ConfigError(
                    f"{type(part).__name__} has no limit cycle to find: a {what} needs get_state and set_state"
                )
        self.batched = isinstance(plant, BatchedPlant) and isinstance(controller, BatchedController)
        self.timestep_s = control_timestep_s * stride
        self._stride = stride
        self._parts = (plant, controller)
        states = self._states()
        self._floats = [list(_slots(state, np.floating, start)) for state, start in _starts(states, np.floating)]
        self._bools = [list(_slots(state, np.bool_, start)) for state, start in _starts(states, np.bool_)]
        self._rest: list[State] = [
            {name: array for name, array in state.items() if array.dtype.kind not in "fb"} for state in states
        ]
        self.labels = tuple(
            label
            for part, slots in zip(self._parts, self._floats, strict=True)
            for slot in slots
            for label in _labels(part, slot)
        )
        self.switch_labels = tuple(
            f"{slot.name}[{i}]" for slots in self._bools for slot in slots for i in range(int(np.prod(slot.shape)))
        )
        self._n_sensed = len(self.switch_labels)
        self._piecewise = controller if kinks and isinstance(controller, Piecewise) else None
        n_pieces = self.present()[1].shape[1] - self._n_sensed
        self.switch_labels += tuple(f"piece[{i}]" for i in range(n_pieces))
        if len(self.labels) > MOST_STATES:
            raise ConfigError(
                f"{type(plant).__name__} and {type(controller).__name__} have {len(self.labels)} continuous states; "
                f"the monodromy by finite differences takes at most {MOST_STATES}: choose a planar body"
            )
        if not (self.batched or isinstance(plant, Senses)):
            raise ConfigError(
                f"{type(plant).__name__} has no limit cycle to find: a plant needs sense(), which tells what it feels"
            )

    def present(self) -> tuple[Array, Switches]:
        """Returns states ``(1, n_states)`` and switches ``(1, n_switches)`` of plant and controller."""
        states = self._states()
        state, switches = _pack(states, self._floats, np.float64), _pack(states, self._bools, np.bool_)
        return state, self._with_pieces(self._unpack(state, switches), switches)

    def step(self, state: Array, switches: Switches) -> tuple[Array, Switches]:
        """Advances copies by one step, as `Flow.step` says."""
        parts = self._unpack(state, switches)
        after = self._step_batch(parts) if self.batched else self._step_each(parts, len(state))
        sensed = _unbatch(after, self._bools, len(state)).astype(bool)
        return _unbatch(after, self._floats, len(state)), self._with_pieces(parts, sensed)

    def part(self, state: Array, switches: Switches, ahead: Array, share: Array) -> Array:
        """Takes shares of steps, each the same share of the change of the whole: exact for forward Euler."""
        part = state + share[:, np.newaxis] * (ahead - state)
        return np.where(share[:, np.newaxis] == 1.0, ahead, part)

    def _unpack(self, state: Array, switches: Switches) -> list[State]:
        parts: list[State] = []
        for floats, bools in zip(self._floats, self._bools, strict=True):
            part: State = {slot.name: state[:, slot.where].reshape(-1, *slot.shape) for slot in floats}
            part |= {slot.name: switches[:, slot.where].reshape(-1, *slot.shape) for slot in bools}
            parts.append(part)
        return parts

    def _with_pieces(self, parts: list[State], sensed: Switches) -> Switches:
        if self._piecewise is None:
            return sensed
        return np.concatenate([sensed, self._piecewise.pieces_copies(parts[1])], axis=1)

    def _states(self) -> list[State]:
        return [cast(Stateful, part).get_state() for part in self._parts]

    def _step_batch(self, parts: list[State]) -> list[State]:
        plant, controller = cast(BatchedPlant, self._parts[0]), cast(BatchedController, self._parts[1])
        of_plant, of_controller = ({**part, **rest} for part, rest in zip(parts, self._rest, strict=True))
        for _ in range(self._stride):
            of_controller, activation = controller.step_copies(of_controller, plant.sense_copies(of_plant))
            of_plant = plant.step_copies(of_plant, activation)
        return [of_plant, of_controller]

    def _step_each(self, parts: list[State], n_copies: int) -> list[State]:
        plant, controller = self._parts
        ends: list[list[State]] = []
        for copy in range(n_copies):
            for part, batch, rest in zip(self._parts, parts, self._rest, strict=True):
                cast(Stateful, part).set_state({name: array[copy] for name, array in batch.items()} | rest)
            sensation = cast(Senses, plant).sense()
            for _ in range(self._stride):
                sensation = plant.step(controller.step(sensation))
            ends.append(self._states())
        return [{name: np.stack([end[i][name] for end in ends]) for name in part} for i, part in enumerate(parts)]


class Continuous:
    """The differential equation behind a flow of small forward Euler steps, integrated by a method of third order.

    The vector field at a state is the change in one step of the flow, over its time; it is exact for forward Euler,
    and of first order in that step otherwise. The method is Ralston's of three stages, which lie within the first
    three quarters of a step: a step that ends where a switch moves has seen the switch at rest.
    Ralston 1962, Math. Comp. 16, 431-437.

    Attributes:
        timestep_s: Duration of a step, s.
        labels: Names of the states.
        switch_labels: Names of the switches.
    """

    def __init__(self, flow: Flow, timestep_s: float) -> None:
        """Takes the flow that gives the vector field, and the step to integrate it with, s."""
        self._flow = flow
        self._ratio = timestep_s / flow.timestep_s
        self.timestep_s = timestep_s
        self.labels, self.switch_labels = flow.labels, flow.switch_labels

    def step(self, state: Array, switches: Switches) -> tuple[Array, Switches]:
        """Returns the states that the field at the beginning leads to in a whole step, and the switches in force."""
        change, switches = self._change(state, switches)
        return state + change, switches

    def part(self, state: Array, switches: Switches, ahead: Array, share: Array) -> Array:
        """Takes shares of steps by Ralston's method."""
        weight = share[:, np.newaxis]
        first = ahead - state
        second = self._held(state + 0.5 * weight * first, switches, first)
        third = self._held(state + 0.75 * weight * second, switches, second)
        return state + weight * (2.0 * first + 3.0 * second + 4.0 * third) / 9.0

    def _held(self, state: Array, switches: Switches, change: Array) -> Array:
        """The change at a stage; where the stage is past a move of a switch, the one before, as if it held still."""
        here, seen = self._change(state, switches)
        return np.where((seen != switches).any(axis=1, keepdims=True), change, here)

    def _change(self, state: Array, switches: Switches) -> tuple[Array, Switches]:
        after, switches = self._flow.step(state, switches)
        return (after - state) * self._ratio, switches


def _starts(states: list[State], kind: type[np.generic]) -> Iterator[tuple[State, int]]:
    start = 0
    for state in states:
        yield state, start
        start += sum(array.size for array in state.values() if np.issubdtype(array.dtype, kind))


def _slots(state: Mapping[str, NDArray[np.generic]], kind: type[np.generic], start: int) -> Iterator[_Slot]:
    for name, array in state.items():
        if np.issubdtype(array.dtype, kind):
            yield _Slot(name, array.shape, slice(start, start + array.size))
            start += array.size


def _pack(states: list[State], slots: list[list[_Slot]], kind: type[np.generic]) -> NDArray:
    flat = [state[slot.name].ravel() for state, own in zip(states, slots, strict=True) for slot in own]
    return np.concatenate([np.empty(0), *flat])[np.newaxis].astype(kind)


def _unbatch(states: list[State], slots: list[list[_Slot]], n_copies: int) -> NDArray:
    flat = [state[slot.name].reshape(n_copies, -1) for state, own in zip(states, slots, strict=True) for slot in own]
    return np.concatenate([np.empty((n_copies, 0)), *flat], axis=1)


def _labels(part: object, slot: _Slot) -> list[str]:
    """A neuron's own name for its potential, else the array's name with the index, counted from 0."""
    size = int(np.prod(slot.shape))
    if isinstance(part, Records):
        recordable = part.recordable()
        for signal in recordable.signals:
            if (
                signal.name == slot.name
                and len(signal.dims) == 1
                and len(recordable.coords.get(signal.dims[0], ())) == size
            ):
                names = recordable.coords[signal.dims[0]]
                return [str(name) for name in names]
    return [f"{slot.name}[{i}]" for i in range(size)]
