"""How a compiled worm is stepped, and what its strands store and lose that the engine does not know of."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import mujoco
import numpy as np

from annelid.morphology import Array
from annelid.protocols import State


class Mechanics:
    """The engine's own step, for strands of which the engine knows all. Formulations derive theirs from it.

    Attributes:
        ahead_s: Time from the posture that a step is prepared for to the end of that step, s.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, step_s: float) -> None:
        """Takes a compiled worm at rest, and its physics step, s."""
        self.model, self.data, self.ahead_s = model, data, step_s

    def step(self, prepare: Callable[[], None]) -> None:
        """Takes a physics step.

        Args:
            prepare: Called with the data in the posture whose geometry the step uses.
        """
        prepare()
        mujoco.mj_step(self.model, self.data)

    def place(self, turn: Array) -> None:
        """Begins in the present state, that of rest turned as a whole by a rotation matrix, ``(3, 3)``."""

    def rest(self) -> None:
        """Goes on from the present state as if the worm had been in it before."""

    def energies_J(self) -> Iterator[float]:
        """Yields what strands and ties store in the present posture, J."""
        yield from ()

    def losses_W(self) -> Iterator[tuple[float, float]]:
        """Yields powers after a step, W: what is lost to dampers, and what the engine takes for that of constraints."""
        yield from ()

    def edge_strain(self) -> Array | None:
        """Returns the largest strain of an edge, ``()``; None where strands have no edges that could stretch."""
        return None

    def pin_gap_m(self) -> Array | None:
        """Returns the largest gap between the two strands of a crossing, m, ``()``; None where they cannot part."""
        return None

    def get_state(self) -> State:
        """Returns what the next step depends on beside the engine's own state."""
        return {}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned, with the engine in its state already."""


NO_GAP = np.zeros(())
"""What is recorded where edges do not stretch or pins cannot part."""
