"""The controllers of a batch of worms: networks step as one batch, other controllers one after another."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np

from annelid.protocols import Array, Sensation, State, Stateful, StridingController
from annelid.simulation.stepping import Simulation

if TYPE_CHECKING:
    from annelid.control import CopySettings


@runtime_checkable
class CopiedController(Stateful, Protocol):
    """The capability of a controller of advancing many copies of itself at once.

    Attributes:
        alike: Equal for controllers that are copies of one another.
        own: What may differ between the copies.
    """

    alike: Hashable
    own: CopySettings

    def step_copies(
        self, states: State, sensation: Sensation, n_steps: int = 1, each: CopySettings | None = None
    ) -> tuple[State, Array]:
        """Returns the copies' states some control steps on, and their activation, ``(n_copies, n_muscles)``."""
        ...


def grouped(simulations: Sequence[Simulation]) -> list[ControllerGroup]:
    """Groups the controllers of worms, each in its initial state: copies that are alike step together."""
    alike: dict[Hashable, list[int]] = {}
    for row, simulation in enumerate(simulations):
        controller = simulation.controller
        copied = isinstance(controller, CopiedController)
        key = (type(controller), controller.alike, simulation.is_noisy) if copied else row
        alike.setdefault(key, []).append(row)
    return [
        (Networks if isinstance(simulations[rows[0]].controller, CopiedController) else ControllerGroup)(
            rows, [simulations[row] for row in rows]
        )
        for rows in alike.values()
    ]


class ControllerGroup:
    """Controllers of some worms between two events of the run; as it is, one controller of any kind.

    Attributes:
        rows: The worms.
    """

    def __init__(self, rows: Sequence[int], simulations: Sequence[Simulation]) -> None:
        """Takes worms that are all noisy or all not."""
        self.rows, self._simulations = list(rows), list(simulations)
        self._strides = not simulations[0].is_noisy and isinstance(simulations[0].controller, StridingController)

    def advance(self, n_steps: int) -> tuple[dict[int, Array], dict[int, Exception]]:
        """Takes control steps with the bodies at rest.

        Returns:
            The activation of every worm after the last of them, and the errors of those whose controllers failed.
        """
        activation: dict[int, Array] = {}
        errors: dict[int, Exception] = {}
        try:
            if self._strides:
                felt = [simulation.sensation for simulation in self._simulations]
                return dict(zip(self.rows, self._take(felt, n_steps), strict=True)), errors
            for later in range(n_steps):
                felt = [_felt(simulation, later) for simulation in self._simulations]
                activation = dict(zip(self.rows, self._take(felt, 1), strict=True))
                for row, simulation in zip(self.rows, self._simulations, strict=True):
                    try:
                        simulation.check_activation(activation[row])
                    except Exception as error:
                        errors.setdefault(row, error)
                if len(errors) == len(self.rows):
                    break
        except Exception as error:
            errors = dict.fromkeys(self.rows, error)
        return activation, errors

    def _take(self, felt: Sequence[Sensation], n_steps: int) -> Sequence[Array]:
        """Takes control steps under what each worm feels; returns each one's activation."""
        controller = self._simulations[0].controller
        if self._strides and isinstance(controller, StridingController):
            return [np.asarray(controller.stride(felt[0], n_steps), dtype=np.float64)]
        return [np.asarray(controller.step(felt[0]), dtype=np.float64)]

    def settle(self) -> None:
        """Brings every worm's own controller up to the state that was reached; here it is the one that steps."""

    def drop(self, row: int) -> None:
        """Leaves out one worm, whose own controller keeps the state that it has reached."""
        place = self.rows.index(row)
        del self.rows[place], self._simulations[place]


def _felt(simulation: Simulation, later: int) -> Sensation:
    """What a worm is told at the beginning of a control step, so many steps after its body's last event."""
    if not later:
        return simulation.observed()
    simulation.step += 1
    return replace(simulation.observed(), time_s=simulation.step * simulation.schedule.timestep_s)


class Networks(ControllerGroup):
    """Synthetic nervous systems, as copies of one that differ in their sensors and currents only."""

    def __init__(self, rows: Sequence[int], simulations: Sequence[Simulation]) -> None:
        """Takes worms that are all noisy or all not, and whose controllers are alike."""
        super().__init__(rows, simulations)
        self._controllers = [c.controller for c in simulations if isinstance(c.controller, CopiedController)]
        self._first = self._controllers[0]
        self._strides = not simulations[0].is_noisy
        states = [controller.get_state() for controller in self._controllers]
        self._states: State = {name: np.stack([state[name] for state in states]) for name in states[0]}
        self._states["n_steps"] = states[0]["n_steps"]
        self._each = type(self._first.own).of(controller.own for controller in self._controllers)

    def _take(self, felt: Sequence[Sensation], n_steps: int) -> Sequence[Array]:
        together = replace(felt[0], stretch_m=np.stack([one.stretch_m for one in felt]))
        self._states, activation = self._first.step_copies(self._states, together, n_steps, self._each)
        return list(activation)

    def settle(self) -> None:
        """Brings the worms' own controllers up to the state of the copies."""
        for place, controller in enumerate(self._controllers):
            controller.set_state({name: own[place] if own.ndim else own for name, own in self._states.items()})

    def drop(self, row: int) -> None:
        """Leaves out one worm, whose own controller keeps the state that it has reached."""
        self.settle()
        place = self.rows.index(row)
        super().drop(row)
        del self._controllers[place]
        self._each = type(self._first.own).of(controller.own for controller in self._controllers)
        self._states = {name: np.delete(own, place, axis=0) if own.ndim else own for name, own in self._states.items()}
