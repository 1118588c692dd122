"""How the engine computes the strands: what all formulations have in common."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple, Self

import numpy as np

from annelid.body.mesh import MeshBody, Strands
from annelid.config.answers import Finding
from annelid.config.kinds import Kind
from annelid.config.run import ArenaKind, RunConfig
from annelid.errors import ConfigError
from annelid.morphology import Array, MeshGeometry
from annelid.registry import Registry

if TYPE_CHECKING:
    import mujoco


def stiffness_shares(geometry: MeshGeometry, strands: Strands) -> Array:
    """Returns how stiff every strand is along itself, over the material of the first segment.

    Returns:
        Shares in bending and in twist at every inner vertex, ``(2, n_strands, n_vertices - 2)``.
    """
    each = [strands.of_segment(segment) for segment in range(geometry.n_segments)]
    moduli = np.array([[one.one_number("young_modulus_Pa"), one.one_number("shear_modulus_Pa")] for one in each])
    along = geometry.along(moduli / moduli[0], geometry.vertices_m[0, 1:-1, 0])
    of_strand = np.array(strands.relative_stiffness or [1.0] * geometry.n_strands)
    return along.T[:, np.newaxis] * of_strand[:, np.newaxis]


def densities_kg_per_m(geometry: MeshGeometry, strands: Strands) -> Array:
    """Returns the mass per length of every element of a strand, which all have alike, ``(n_elements,)``."""
    x = geometry.vertices_m[0, :, 0]
    each = strands.of_each("linear_density_kg_per_m", geometry.n_segments)
    return geometry.along(each, (x[:-1] + x[1:]) / 2)


BDF2_SHARE = 2.0 / 3.0
"""Length of the engine's step over that of a whole step by BDF2."""

PinReader = Callable[[Mapping[str, Array]], Array]
"""Reads the largest gap at a pin, m, from the engine's arrays."""


class Tie(NamedTuple):
    """A spring and a dashpot between a pin and a vertex of each of its strands."""

    stiffness_N_per_m: float
    damping_Ns_per_m: float


class FormulationKind(Kind):
    """Base of the formulations' sections.

    Attributes:
        is_papers: Whether it is the paper's own, which other formulations are compared with.
        friction_cone: Elliptic: friction is alike in every direction of sliding; pyramidal, the engine's default and
            that of the authors' files: it is weaker by 16 % at 45 degrees to the world's axes.
        has_rods: Whether strands are rods, whose rows a plant renews (`annelid.body.formulations.rods.strains`).
    """

    registry: ClassVar[Registry[type[Any]]] = Registry("body.formulation.kind", "annelid.body.formulations")
    default: ClassVar[str] = "rods"
    is_papers: ClassVar[bool] = False
    friction_cone: ClassVar[Literal["elliptic", "pyramidal"]] = "elliptic"
    has_rods: ClassVar[bool] = False

    def engine_share(self, arena: ArenaKind) -> float:
        """Length of the engine's step over the physics step of a plant: 1, or `BDF2_SHARE` (`simulation.two_step`)."""
        return 1.0

    @property
    @abstractmethod
    def step_cost_ms(self) -> float:
        """About how long a step of three segments with three elements a side takes, ms."""

    def lacks_in_mjcf(self, body: MeshBody) -> str:
        """Returns a sentence on how a body differs from its model in an MJCF file, or ""."""
        return ""

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

    def check_body(self, body: MeshBody) -> None:
        """Checks the section against the rest of its body.

        Raises:
            ValueError: They do not fit.
        """

    def findings(self, config: RunConfig) -> Iterator[Finding]:
        """Checks the physics step against what the formulation must resolve, before a run; by default finds nothing."""
        yield from ()

    @abstractmethod
    def add(
        self, spec: mujoco.MjSpec, geometry: MeshGeometry, body: MeshBody, arena: ArenaKind, *, for_plant: bool
    ) -> None:
        """Adds the mesh with a site at every crossing, and the solver settings that it needs.

        Args:
            spec: An empty spec.
            geometry: The mesh at rest.
            body: Materials and pins.
            arena: Contact settings, which the strands share with the floor.
            for_plant: For a plant of annelid, which prepares every step, as `annelid.body.build_spec`.
        """

    def pin_reader(self, model: mujoco.MjModel, geometry: MeshGeometry) -> tuple[PinReader | None, tuple[str, ...]]:
        """Finds what reads the largest gap at a pin.

        Args:
            model: The compiled body.
            geometry: The mesh at rest.

        Returns:
            The reader, None where pins cannot part, and names of the engine's arrays that it needs.
        """
        return None, ()

    def refuse_fidelity(self, level: str) -> None:
        """Refuses a level of fidelity, as `BodyKind.refuse_fidelity`.

        Raises:
            ConfigError: The levels were not measured with this formulation.
        """
        raise ConfigError(
            f"fidelity = {level!r} is for worms of rods, not for body.formulation.kind = {self.kind!r}: set "
            "body.mesh.elements_per_side and clock.physics_timestep_s, or take the preset riddle2023-rods"
        )

    def hastened(self, haste: float) -> Self:
        """Returns the section with its viscous coefficients divided."""
        return self
