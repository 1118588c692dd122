"""The controllers of a batch of worms: networks step as one batch, other controllers one after another."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import replace
from typing import Protocol, runtime_checkable

import numpy as np

from annelid.config import RunConfig
from annelid.control import CopySettings
from annelid.protocols import Array, Sensation, State, StridingController
from annelid.simulation.coupling import Coupling

Outcome = tuple[dict[int, Array], dict[int, Exception]]
"""Activation of every worm, and the errors of those that failed, by number of the worm."""


@runtime_checkable
class CopiedController(Protocol):
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

    def get_state(self) -> State:
        """Returns copies of all that the next step depends on."""
        ...

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        ...


class ControllerBatch:
    """Controllers of many worms between two events of the run."""

    def __init__(self, configs: Sequence[RunConfig], couplings: Sequence[Coupling]) -> None:
        """Groups controllers that can step together.

        Args:
            configs: The worms' configurations.
            couplings: The worms, each with its controller in its initial state.
        """
        alike: dict[Hashable, list[int]] = {}
        for row, config in enumerate(configs):
            alike.setdefault(_group(couplings[row], config, row), []).append(row)
        self._groups = [
            _Networks(rows, [couplings[row] for row in rows], noisy=configs[rows[0]].sensor.noise_m > 0)
            if isinstance(couplings[rows[0]].controller, CopiedController)
            else _Single(rows[0], couplings[rows[0]], noisy=configs[rows[0]].sensor.noise_m > 0)
            for rows in alike.values()
        ]

    def advance(self, n_steps: int) -> Outcome:
        """Takes control steps during which no body moves.

        Returns:
            The activation after the last of them, and the error of every controller that failed.
        """
        activation: dict[int, Array] = {}
        errors: dict[int, Exception] = {}
        for group in self._groups:
            of_group, errors_of_group = group.advance(n_steps)
            activation |= of_group
            errors |= errors_of_group
        return activation, errors

    def settle(self) -> None:
        """Brings every worm's own controller up to the state that the batch has reached."""
        for group in self._groups:
            group.settle()

    def drop(self, row: int) -> None:
        """Leaves out a worm that has ended."""
        for group in self._groups:
            group.drop(row)
        self._groups = [group for group in self._groups if group.rows]


def _group(coupling: Coupling, config: RunConfig, row: int) -> Hashable:
    """Tells which controllers may step together: copies that are alike, noisy or not."""
    controller = coupling.controller
    if not isinstance(controller, CopiedController):
        return row
    return type(controller), controller.alike, config.sensor.noise_m > 0


def _advance_with_time(couplings: Sequence[Coupling], later: int) -> list[Sensation]:
    """What worms are told at the beginning of a control step, ``later`` steps after their bodies' last event."""
    if later:
        for coupling in couplings:
            coupling.step += 1
    return [
        replace(coupling.felt(), time_s=coupling.step * coupling.schedule.timestep_s) if later else coupling.felt()
        for coupling in couplings
    ]


class _Networks:
    """Synthetic nervous systems, as copies of one that differ in their sensors and currents only."""

    def __init__(self, rows: Sequence[int], couplings: Sequence[Coupling], noisy: bool) -> None:
        self.rows = list(rows)
        self._couplings = list(couplings)
        self._controllers = [c.controller for c in couplings if isinstance(c.controller, CopiedController)]
        self._first = self._controllers[0]
        states = [controller.get_state() for controller in self._controllers]
        self._states: State = {name: np.stack([state[name] for state in states]) for name in states[0]}
        self._states["n_steps"] = states[0]["n_steps"]
        self._each = CopySettings.of(controller.own for controller in self._controllers)
        self._noisy = noisy

    def advance(self, n_steps: int) -> Outcome:
        """Takes control steps with the bodies at rest."""
        if not self._noisy:
            return self._take([coupling.sensation for coupling in self._couplings], n_steps), {}
        activation: dict[int, Array] = {}
        errors: dict[int, Exception] = {}
        for later in range(n_steps):
            activation = self._take(_advance_with_time(self._couplings, later), 1)
            for row, coupling in zip(self.rows, self._couplings, strict=True):
                try:
                    coupling.check_activation(activation[row])
                except Exception as error:
                    errors.setdefault(row, error)
        return activation, errors

    def _take(self, felt: Sequence[Sensation], n_steps: int) -> dict[int, Array]:
        together = replace(felt[0], stretch_m=np.stack([one.stretch_m for one in felt]))
        self._states, activation = self._first.step_copies(self._states, together, n_steps, self._each)
        return dict(zip(self.rows, list(activation), strict=True))

    def settle(self) -> None:
        """Brings the worms' own controllers up to the state of the copies."""
        for place, controller in enumerate(self._controllers):
            controller.set_state(self._state_of(place))

    def _state_of(self, place: int) -> State:
        return {name: values[place] if values.ndim else values for name, values in self._states.items()}

    def drop(self, row: int) -> None:
        """Leaves out one worm, whose own controller keeps the state it has reached."""
        if row not in self.rows:
            return
        place = self.rows.index(row)
        self._controllers[place].set_state(self._state_of(place))
        for members in (self.rows, self._couplings, self._controllers):
            del members[place]
        self._each = CopySettings.of(controller.own for controller in self._controllers)
        self._states = {
            name: np.delete(values, place, axis=0) if values.ndim else values for name, values in self._states.items()
        }


class _Single:
    """One controller of any kind."""

    def __init__(self, row: int, coupling: Coupling, noisy: bool) -> None:
        self.rows = [row]
        self._coupling = coupling
        controller = coupling.controller
        self._strider = controller if isinstance(controller, StridingController) and not noisy else None

    def advance(self, n_steps: int) -> Outcome:
        """Takes control steps with the body at rest."""
        coupling, activation = self._coupling, np.empty(0)
        try:
            if self._strider is not None:
                activation = np.asarray(self._strider.stride(coupling.sensation, n_steps), dtype=np.float64)
                n_steps = 0
            for later in range(n_steps):
                (felt,) = _advance_with_time([coupling], later)
                activation = np.asarray(coupling.controller.step(felt), dtype=np.float64)
                coupling.check_activation(activation)
        except Exception as error:
            return {}, dict.fromkeys(self.rows, error)
        return dict.fromkeys(self.rows, activation), {}

    def settle(self) -> None:
        """Does nothing: the worm's own controller is the one that steps."""

    def drop(self, row: int) -> None:
        """Leaves out the worm, if it is this one."""
        if row in self.rows:
            self.rows.remove(row)
