"""How rods are stepped, and what they store and lose: rows of constraints, which the engine takes for any others."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import mujoco
import numpy as np

from annelid.body.constraint_rows import Ties
from annelid.body.formulations import Tie
from annelid.body.formulations.rods.net import vertex_name
from annelid.body.formulations.rods.strains import RodStrains, RodVertices, net_stiffness
from annelid.body.formulations.rods.two_step import TwoStep
from annelid.body.mechanics import Mechanics
from annelid.body.mesh import MeshBody
from annelid.morphology import Array, norm
from annelid.protocols import State


class RodMechanics(Mechanics):
    """Steps of second order, in which all geometry is that of the predicted end.

    Attributes:
        strains: Bending and twist.
        two_step: What steps them.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        body: MeshBody,
        tie: Tie | None,
        step_s: float,
        *,
        first_order: bool,
    ) -> None:
        """Completes the rows of a model built for a plant, with a tie between separate pins and their strands."""
        # What the predicted end of a step has yet to move is nothing.
        super().__init__(model, data, 0.0)
        self._engine_lacks_s = step_s - model.opt.timestep
        geometry = body.geometry()
        self.strains = RodStrains(model, net_stiffness(geometry, body.strands), body.strands.damping_time_s)
        self.two_step = TwoStep(model, data, self.strains, first_order=first_order)
        self._vertices, self._edges_per_m = RodVertices(model), 1.0 / model.flexedge_length0
        self._ties = None if tie is None else Ties(model, tie)
        if tie is not None:
            places = zip(geometry.crossing_strands, geometry.crossing_vertex[geometry.crossing_plane], strict=True)
            names = [[vertex_name(strand, vertex) for strand in pair] for pair, vertex in places]
            bodies = np.array([[model.body(name).id for name in pair] for pair in names])
            self._pinned = model.jnt_qposadr[model.body_jntadr[bodies]][..., None] + np.arange(3)

    def step(self, prepare: Callable[[], None]) -> None:
        """Takes a physics step, as `Mechanics.step`."""
        self.two_step.step(prepare)
        self.data.time += self._engine_lacks_s

    def place(self, turn: Array) -> None:
        """Begins at rest, as `Mechanics.place`."""
        self.strains.place(self.data.qpos, turn)
        self.two_step.rest()

    def rest(self) -> None:
        """Takes the present state for that of one step ago."""
        self.two_step.rest()

    def energies_J(self) -> Iterator[float]:
        """Yields the energy of ties and of rods, J."""
        if self._ties is not None:
            yield self._ties.energy_J(self.data.qpos)
        yield self.strains.energy_J()

    def losses_W(self) -> Iterator[tuple[float, float]]:
        """Yields what the material takes, and all that its rows and those of ties take, W."""
        force, rate = self.two_step.rows()
        yield self.strains.loss_W(rate), -float(force @ rate)
        if self._ties is not None:
            springs, dashpots = self._ties.power_W(self.data.qpos, self.data.qvel)
            yield dashpots, dashpots
            yield 0.0, springs

    def edge_strain(self) -> Array:
        """Returns the largest strain of an edge, ``()``."""
        edge = self._vertices.edges(self.data.qpos)
        squares = edge * edge
        lengths = np.sqrt(squares[0] + squares[1] + squares[2])
        return np.abs(lengths.ravel() * self._edges_per_m - 1.0).max()

    def pin_gap_m(self) -> Array | None:
        """Returns the largest gap at a separate pin, m, ``()``."""
        if self._ties is None:
            return None
        ends = self.data.qpos.take(self._pinned)
        return norm(ends[..., 1, :] - ends[..., 0, :]).max()

    def get_state(self) -> State:
        """Returns the state of one step ago and the directors."""
        return self.two_step.get_state()

    def set_state(self, state: State) -> None:
        """Restores them."""
        self.two_step.set_state(state)
