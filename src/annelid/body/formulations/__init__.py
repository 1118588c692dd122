"""How the engine computes the strands: what all formulations have in common."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from annelid.body.mesh import MeshBody, Strands
from annelid.config.answers import Finding
from annelid.config.kinds import Kind
from annelid.config.run import ArenaKind, RunConfig
from annelid.morphology import Array, MeshGeometry
from annelid.registry import Registry

if TYPE_CHECKING:
    import mujoco

    from annelid.body.mechanics import Mechanics


def stiffness_shares(geometry: MeshGeometry, strands: Strands) -> Array:
    """Returns how stiff the strands are along themselves, over the material of the first segment.

    Returns:
        Shares in bending and in twist at every inner vertex, alike in all strands, ``(2, n_vertices - 2)``.
    """
    each = [strands.of_segment(segment) for segment in range(geometry.n_segments)]
    moduli = np.array([[one.one_number("young_modulus_Pa"), one.one_number("shear_modulus_Pa")] for one in each])
    return geometry.along(moduli / moduli[0], geometry.vertices_m[0, 1:-1, 0]).T


def densities_kg_per_m(geometry: MeshGeometry, strands: Strands) -> Array:
    """Returns the mass per length of every element of a strand, which all have alike, ``(n_elements,)``."""
    x = geometry.vertices_m[0, :, 0]
    each = strands.of_each("linear_density_kg_per_m", geometry.n_segments)
    return geometry.along(each, (x[:-1] + x[1:]) / 2)


BDF2_SHARE = 2.0 / 3.0
"""Length of the engine's step over that of a whole step by BDF2."""
FIRM_FRICTION = 100.0
"""Least impedance ratio with which a worm at rest on a slope creeps by less than 1 mm/s (docs/evidence/arenas.md)."""
CREEPS = "on a slope, what rests slides down by millimetres to centimetres a second"
"""What a formulation finds where friction yields more."""


WRITTEN = "written_order"
"""Name, in the model of a plant, of its own number of each body, in the order that written models have."""


class Tie(NamedTuple):
    """A spring and a dashpot between a pin and a vertex of each of its strands."""

    stiffness_N_per_m: float
    damping_Ns_per_m: float


class FormulationKind(Kind):
    """Base of the formulations' sections.

    Attributes:
        is_papers: Whether it is the paper's own, which other formulations are compared with.
        step_cost_ms: About how long a step of three segments with three elements a side takes, ms.
    """

    registry: ClassVar[Registry[type[Any]]] = Registry("body.formulation.kind", "annelid.body.formulations")
    default: ClassVar[str] = "rods"
    is_papers: ClassVar[bool] = False
    step_cost_ms: ClassVar[float]

    def engine_share(self, arena: ArenaKind) -> float:
        """Length of the engine's step over the physics step of a plant: 1, or `BDF2_SHARE` (`rods.two_step`)."""
        return 1.0

    @property
    def has_rigid_crossings(self) -> bool:
        """Whether the two strands of a crossing share a point."""
        return False

    @property
    def tie(self) -> Tie | None:
        """What ties pins to their strands, where those are springs of a given stiffness."""
        return None

    @abstractmethod
    def build_cost(self, n_elements: int, n_helices: int) -> tuple[float, float]:
        """Estimates what it takes to build a mesh.

        Args:
            n_elements: Straight elements of all strands.
            n_helices: Number of strands.

        Returns:
            The time, s, and the memory, GB.
        """

    def findings(self, config: RunConfig) -> Iterator[Finding]:
        """Checks the physics step against what the formulation must resolve, before a run; by default finds nothing."""
        yield from ()

    @abstractmethod
    def add(
        self, spec: mujoco.MjSpec, geometry: MeshGeometry, body: MeshBody, arena: ArenaKind, *, for_plant: bool
    ) -> None:
        """Adds the mesh with a site at every crossing, and the solver settings and friction cone that it needs.

        Args:
            spec: An empty spec.
            geometry: The mesh at rest.
            body: Materials and pins.
            arena: Contact settings, which the strands share with the floor.
            for_plant: For a plant of annelid, which prepares every step, as `annelid.body.build_spec`.
        """

    @abstractmethod
    def mechanics(
        self, model: mujoco.MjModel, data: mujoco.MjData, body: MeshBody, arena: ArenaKind, step_s: float
    ) -> Mechanics:
        """Returns what steps a body that `add` has built for a plant.

        Args:
            model: The compiled body.
            data: The engine's data of it.
            body: The mesh, materials and pins.
            arena: Where it is.
            step_s: Physics step, s.
        """
