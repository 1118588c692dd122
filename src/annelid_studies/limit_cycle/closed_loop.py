"""Autonomous flows of one state vector: the closed loop of plant and controller, and steps that end at a switch.

A step of a `Flow` is smooth as long as its switches, such as stretch sensors that are on or off, keep still. When one
moves within a step, the step is shortened to the instant of the switch, which bisection finds, and a new one begins
there, so that finite differences carry the jump of the vector field at the switch (the saltation matrix; Leine &
Nijmeijer 2004, ch. 7).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, cast, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from annelid.errors import ConfigError
from annelid.protocols import Array, Controller, Plant, Records, Sensation, State, Stateful

Switches = NDArray[np.bool_]

MOST_STATES = 400  # continuous states beyond which a monodromy by finite differences is refused
# Halvings of a step that locate an event: to 1e-9 of the step.
_HALVINGS = 30


class Flow(Protocol):
    """An autonomous system with continuous states and switches, advanced in fixed steps, many copies at once.

    A step reads the switches from the state at its beginning (and from what they were, for hysteresis) and
    advances under them; between two switchings the step is smooth.
    """

    timestep_s: float
    labels: tuple[str, ...]  # names of the continuous states

    def step(self, state: Array, switches: Switches) -> tuple[Array, Switches]:
        """Advances copies, ``(n_copies, n_states)``, by one step.

        Takes the switches of the step before, ``(n_copies, n_switches)``. Returns new arrays: the states one step on,
        and the switches in force during this step.
        """
        ...

    def part(self, state: Array, switches: Switches, ahead: Array, share: Array) -> Array:
        """Returns the states after shares of steps in [0, 1], ``(n_copies,)``, up to the section or a switch's move.

        ``switches`` are those in force, and ``ahead`` is what `step` returned for them.
        """
        ...


@runtime_checkable
class BatchedPlant(Protocol):
    """The capability of a plant of advancing many copies at once.

    States are as `Stateful.get_state` returns them, with one more axis in front, ``n_copies`` long, of every array
    of floats and booleans; integers, such as the number of steps taken, are shared by all copies.
    """

    def sense_copies(self, states: State) -> Sensation:
        """Returns their sensations: every array with the copies' axis in front, and one time for all."""
        ...

    def step_copies(self, states: State, activation: Array) -> State:
        """Returns their states one control step on, under activation ``(n_copies, n_muscles)``."""
        ...


@runtime_checkable
class BatchedController(Protocol):
    """The capability of a controller of advancing many copies at once; states are as for `BatchedPlant`."""

    def step_copies(self, states: State, sensation: Sensation) -> tuple[State, Array]:
        """Returns their states one control step on, and its activation, ``(n_copies, n_muscles)``."""
        ...

    def pieces_copies(self, states: State) -> Switches:
        """Returns in which smooth piece of its equations each copy is, ``(n_copies, n_pieces)``."""
        ...


class ClosedLoop:
    """Plant and controller, in their present state, as a `Flow`.

    The state is every array of floats in `get_state` of both, plant first; the switches are every array of booleans.
    Integers, such as the number of steps taken, stay as they are now: what depends on them, a kick at the first step or
    a hold at the start, must be over by then. Potentials are labelled by their neurons, other states such as
    ``height[2]``.
    """

    def __init__(self, plant: Plant, controller: Controller, control_timestep_s: float) -> None:
        """Takes a plant and a controller, which are stepped by this from now on.

        Args:
            plant: The body.
            controller: The controller.
            control_timestep_s: Duration of a control step, s.

        Raises:
            ConfigError: One of them cannot be saved, restored and advanced in many copies, or has too many states.
        """
        for part, batched in ((plant, BatchedPlant), (controller, BatchedController)):
            if not (isinstance(part, Stateful) and isinstance(part, batched)):
                raise ConfigError(
                    f"{type(part).__name__} has no limit cycle to find, since copies of it cannot be advanced at once: "
                    "choose the body riddle2022 and the controller sns"
                )
        self.timestep_s = control_timestep_s
        self._parts = (plant, controller)
        self._made_of = self._states()
        self._rest: list[State] = [
            {name: array for name, array in state.items() if array.dtype.kind not in "fb"} for state in self._made_of
        ]
        self.labels: tuple[str, ...] = ()
        for part, state in zip(self._parts, self._made_of, strict=True):
            floats = ((name, array.size) for name, array in state.items() if array.dtype.kind == "f")
            self.labels += tuple(label for name, size in floats for label in _labels(part, name, size))
        if len(self.labels) > MOST_STATES:
            raise ConfigError(
                f"{type(plant).__name__} and {type(controller).__name__} have {len(self.labels)} continuous states; "
                f"the monodromy by finite differences takes at most {MOST_STATES}: choose fewer segments"
            )

    def present(self) -> tuple[Array, Switches]:
        """Returns states ``(1, n_states)`` and switches ``(1, n_switches)`` of plant and controller."""
        states = self._states()
        state, switches = self._packed(states, "f", 1), self._packed(states, "b", 1).astype(bool)
        return state, self._with_pieces(self._unpacked(state, switches), switches)

    def step(self, state: Array, switches: Switches) -> tuple[Array, Switches]:
        """Advances copies by one step, as `Flow.step` says."""
        parts, n_copies = self._unpacked(state, switches), len(state)
        after = self._step_copies(parts)
        sensed = self._packed(after, "b", n_copies).astype(bool)
        return self._packed(after, "f", n_copies), self._with_pieces(parts, sensed)

    def part(self, state: Array, switches: Switches, ahead: Array, share: Array) -> Array:
        """Takes shares of steps, each the same share of the change of the whole: exact for forward Euler."""
        part = state + share[:, np.newaxis] * (ahead - state)
        return np.where(share[:, np.newaxis] == 1.0, ahead, part)

    def _states(self) -> list[State]:
        return [cast(Stateful, part).get_state() for part in self._parts]

    def _packed(self, states: list[State], kind: str, n_copies: int) -> NDArray:
        """Arrays of a kind of dtype of both parts, as one vector a copy."""
        names = ((i, name) for i, part in enumerate(self._made_of) for name, a in part.items() if a.dtype.kind == kind)
        flat = [states[i][name].reshape(n_copies, -1) for i, name in names]
        return np.concatenate([np.empty((n_copies, 0)), *flat], axis=1)

    def _unpacked(self, state: Array, switches: Switches) -> list[State]:
        left: dict[str, NDArray] = {"f": state, "b": switches}
        parts: list[State] = [{}, {}]
        for part, made_of in zip(parts, self._made_of, strict=True):
            for name, array in made_of.items():
                if (kind := array.dtype.kind) in left:
                    part[name] = left[kind][:, : array.size].reshape(-1, *array.shape)
                    left[kind] = left[kind][:, array.size :]
        return parts

    def _with_pieces(self, parts: list[State], sensed: Switches) -> Switches:
        return np.concatenate([sensed, cast(BatchedController, self._parts[1]).pieces_copies(parts[1])], axis=1)

    def _step_copies(self, parts: list[State]) -> list[State]:
        plant, controller = cast(BatchedPlant, self._parts[0]), cast(BatchedController, self._parts[1])
        of_plant, of_controller = (part | rest for part, rest in zip(parts, self._rest, strict=True))
        of_controller, activation = controller.step_copies(of_controller, plant.sense_copies(of_plant))
        return [plant.step_copies(of_plant, activation), of_controller]


def _labels(part: object, name: str, size: int) -> list[str]:
    """A neuron's own name for its potential, else the array's name with the index, counted from 0."""
    if isinstance(part, Records):
        recordable = part.recordable()
        for signal in recordable.signals:
            names = recordable.coords.get(signal.dims[0], ()) if len(signal.dims) == 1 else ()
            if signal.name == name and len(names) == size:
                return [str(own) for own in names]
    return [f"{name}[{i}]" for i in range(size)]


class Continuous:
    """The differential equation behind a flow of small forward Euler steps, integrated by a method of third order.

    The vector field at a state is the change in one step of the flow, over its time; it is exact for forward Euler,
    and of first order in that step otherwise. The method is Ralston's of three stages, which lie within the first
    three quarters of a step: a step that ends where a switch moves has seen the switch at rest.
    Ralston 1962, Math. Comp. 16, 431-437.
    """

    def __init__(self, flow: Flow, timestep_s: float) -> None:
        self._flow = flow
        self._ratio = timestep_s / flow.timestep_s
        self.timestep_s = timestep_s
        self.labels = flow.labels

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
        """The change at a stage; where the stage is past a move of a switch, the one before, as if it did not move."""
        here, seen = self._change(state, switches)
        return np.where((seen != switches).any(axis=1, keepdims=True), change, here)

    def _change(self, state: Array, switches: Switches) -> tuple[Array, Switches]:
        after, switches = self._flow.step(state, switches)
        return (after - state) * self._ratio, switches


@dataclass(slots=True)
class Copies:
    """Copies at some instant: state, switches in force, and where a whole step from here leads."""

    state: Array
    switches: Switches
    ahead: Array

    @classmethod
    def at(cls, flow: Flow, state: Array, before: Switches) -> Copies:
        """Copies about to take a step; ``before`` are their switches as they were."""
        ahead, switches = flow.step(state, before)
        return cls(state, switches, ahead)

    def __getitem__(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Copies:
        return Copies(self.state[rows], self.switches[rows], self.ahead[rows])

    def __setitem__(self, rows: NDArray[np.intp] | NDArray[np.bool_], those: Copies) -> None:
        self.state[rows], self.switches[rows], self.ahead[rows] = those.state, those.switches, those.ahead

    def part(self, flow: Flow, share: Array) -> Array:
        """States after a share of the step."""
        return flow.part(self.state, self.switches, self.ahead, share)


def advance(flow: Flow, here: Copies, share: Array) -> tuple[Copies, Array]:
    """Takes a share of one step, or less, up to the first move of a switch; returns the share taken."""
    there = Copies.at(flow, here.part(flow, share), here.switches)
    moved = np.flatnonzero((there.switches != here.switches).any(axis=1) & (share > 0.0))
    if not moved.size:
        return there, share
    base = here[moved]

    def past(state: Array) -> NDArray[np.bool_]:
        return (flow.step(state, base.switches)[1] != base.switches).any(axis=1)

    share = share.copy()
    share[moved] = first_share(flow, base, share[moved], past)
    there[moved] = Copies.at(flow, base.part(flow, share[moved]), base.switches)
    return there, share


def first_share(flow: Flow, here: Copies, share: Array, past: Callable[[Array], NDArray[np.bool_]]) -> Array:
    """Bisects for the share of the step at which an event has just passed; it has by the share given."""
    low, high = np.zeros(len(share)), share
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        over = past(here.part(flow, middle))
        low, high = np.where(over, low, middle), np.where(over, middle, high)
    return high


def travel(flow: Flow, state: Array, before: Switches, duration_s: Array) -> Copies:
    """Lets copies, ``(n_copies, n_states)``, run for their own durations, s, ``(n_copies,)``; returns them at the ends.

    ``before`` are the switches as they were before, ``(n_copies, n_switches)``.
    """
    left = np.asarray(duration_s, dtype=float) / flow.timestep_s
    done = Copies.at(flow, state, before)
    rows, here = np.arange(len(left)), done
    while rows.size:
        # A remainder of 1e-9 steps is the rounding of sums of steps.
        share = np.where(np.abs(left[rows] - 1.0) < 1e-9, 1.0, np.minimum(left[rows], 1.0))
        here, taken = advance(flow, here, share)
        left[rows] -= taken
        ended = left[rows] < 1e-9
        if ended.any():
            done[rows[ended]] = here[ended]
            rows, here = rows[~ended], here[~ended]
    return done
