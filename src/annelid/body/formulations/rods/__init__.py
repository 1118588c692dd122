"""The fast formulation: elastic rods."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, ClassVar, Literal, Self

import numpy as np
from pydantic import Field

from annelid.body.formulations import BDF2_SHARE, FormulationKind, PinReader, Tie
from annelid.body.mesh import MeshBody
from annelid.config.answers import Finding
from annelid.config.run import ArenaKind, RunConfig
from annelid.config.sections import Positive
from annelid.errors import ConfigError
from annelid.morphology import Array, MeshGeometry, norm

if TYPE_CHECKING:
    import mujoco


class Rods(FormulationKind):
    """The fast formulation: elastic rods, which share one vertex at each crossing unless pins are separate."""

    cites: ClassVar[tuple[tuple[str, str], ...]] = (("bergou2008", "the rods of the mesh"),)
    has_rods: ClassVar[bool] = True
    kind: Literal["rods"] = "rods"
    edge_time_constant_s: Positive = Field(default=0.001, description="time constant of the inextensible edges")
    friction_impedance_ratio: Positive = Field(
        default=100.0, description="MuJoCo's impratio; 1 lets light vertices creep on the floor"
    )
    pins: Literal["shared", "separate"] = Field(
        default="shared",
        description="both strands of a crossing share its vertex, or a pin mass is tied to a vertex of each",
    )
    pin_stiffness_N_per_m: Positive = Field(
        default=22.0, description="of the tie between a separate pin and each of its strands"
    )
    pin_damping_Ns_per_m: Positive = Field(default=0.88, description="of the same tie")

    @property
    def step_cost_ms(self) -> float:
        """About how long a step takes, ms."""
        return 4.5

    def engine_share(self, arena: ArenaKind) -> float:
        """Length of the engine's step, as `FormulationKind.engine_share`.

        It is the whole step where bodies of a scene move: from an extrapolated state their contacts would rebound, and
        what the engine steps explicitly, such as a pendulum's weight, would swing ever farther.
        """
        return 1.0 if arena.object_names else BDF2_SHARE

    @property
    def tie(self) -> Tie | None:
        """What ties separate pins to their strands."""
        return None if self.pins == "shared" else Tie(self.pin_stiffness_N_per_m, self.pin_damping_Ns_per_m)

    @property
    def has_rigid_crossings(self) -> bool:
        """Whether the strands of a crossing share its vertex."""
        return self.pins == "shared"

    def lacks_in_mjcf(self, body: MeshBody) -> str:
        """Says that MJCF has one stiffness for a rod, as `FormulationKind.lacks_in_mjcf`."""
        if body.mesh.elements_per_side == 1:
            return ""
        return (
            "a rod in MJCF is equally stiff at every vertex, while annelid bends it as forces at its crossings do: the "
            "segments of the written worm elongate by 7 % less than here with two elements a side, by 1 % with six"
        )

    def build_cost(self, n_elements: int, n_helices: int) -> tuple[float, float]:
        """Estimates time, s, and memory, GB; measured on one core: the factorisation fills with the helices."""
        return 1e-8 * n_elements**2 * n_helices, 2e-6 * n_elements * n_helices

    def findings(self, config: RunConfig) -> Iterator[Finding]:
        """Checks the step against the edges."""
        step = config.clock.physics_timestep_s
        field, most = "clock.physics_timestep_s", 0.06
        if step > most:
            problem = f"rods are measured up to {most:g} s, where their edges stretch by 3 %"
            yield Finding(field, step, problem, f"set at most {most:g}")

    def add(
        self, spec: mujoco.MjSpec, geometry: MeshGeometry, body: MeshBody, arena: ArenaKind, *, for_plant: bool
    ) -> None:
        """Adds the mesh as a net of rods, whose vertices touch in any case."""
        from annelid.body.formulations.rods.net import add_rods

        spec.option.impratio = self.friction_impedance_ratio
        add_rods(spec, geometry, body, arena, self.edge_time_constant_s, self.tie, for_plant=for_plant)

    def pin_reader(self, model: mujoco.MjModel, geometry: MeshGeometry) -> tuple[PinReader | None, tuple[str, ...]]:
        """Reads separate pins, as `FormulationKind.pin_reader`."""
        if self.pins == "shared":
            return None, ()
        from annelid.body.formulations.rods.net import vertex_name

        places = zip(geometry.crossing_strands.tolist(), geometry.crossing_vertex[geometry.crossing_plane], strict=True)
        bodies = np.array([[model.body(vertex_name(strand, vertex)).id for strand in pair] for pair, vertex in places])
        slides = model.jnt_qposadr[model.body_jntadr[bodies]][..., None] + np.arange(3)

        def gap(engine: Mapping[str, Array]) -> Array:
            ends = engine["qpos"].take(slides, axis=-1)
            return norm(ends[..., 1, :] - ends[..., 0, :]).max(axis=-1)

        return gap, ("qpos",)

    def refuse_fidelity(self, level: str) -> None:
        """Refuses any level for separate pins: the errors of the levels were measured without."""
        if self.pins == "separate":
            raise ConfigError(
                f"fidelity = {level!r} is measured for rods that share their pins, not for body.formulation.pins = "
                "'separate': take the preset riddle2023-rods, or set body.mesh.elements_per_side and "
                "clock.physics_timestep_s"
            )

    def hastened(self, haste: float) -> Self:
        """Returns the section with its viscous coefficient divided."""
        return self.model_copy(update={"pin_damping_Ns_per_m": self.pin_damping_Ns_per_m / haste})
