"""The fast formulation: elastic rods."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field

from annelid.body.estimates import Finding
from annelid.body.formulations import BDF2_SHARE, FormulationKind, PinReader, Tie
from annelid.config.sections import NonNegative, Positive
from annelid.errors import ConfigError
from annelid.morphology import Array, MeshGeometry, norm

if TYPE_CHECKING:
    import mujoco

    from annelid.body.worm import WormBody
    from annelid.config.arena import ArenaKind
    from annelid.config.run import RunConfig


class Rods(FormulationKind):
    """The fast formulation: elastic rods, which share one vertex at each crossing unless pins are separate."""

    cites: ClassVar[tuple[tuple[str, str], ...]] = (("bergou2008", "the rods of the mesh"),)
    damps_material: ClassVar[bool] = True
    kind: Literal["rods"] = "rods"
    edge_time_constant_s: Positive = Field(default=0.001, description="time constant of the inextensible edges")
    solver_iterations: Annotated[int, Field(ge=10, le=100_000)] = Field(
        default=100, description="Newton iterations at most"
    )
    solver_tolerance: NonNegative = Field(default=1e-6, description="Newton tolerance")
    friction_impedance_ratio: Positive = Field(
        default=100.0, description="MuJoCo's impratio; 1 lets light vertices creep on the floor"
    )
    curvature: Literal["linear", "constant"] = Field(
        default="linear",
        description="of a strand between two crossings: linear, as forces at the crossings bend it, or constant about "
        "every vertex, as the engine has it; the same in fine meshes",
    )
    integrator: Literal["Euler", "BDF2"] = Field(
        default="Euler",
        description="implicit time integration: of first order, as the engine has it, which damps motion as one to two "
        "steps more of damping time do, or of second order, for strands whose material is damped (not used in "
        "scenes with bodies that move)",
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
        return BDF2_SHARE if self.integrator == "BDF2" and not arena.object_names else 1.0

    @property
    def tie(self) -> Tie | None:
        """What ties separate pins to their strands."""
        return None if self.pins == "shared" else Tie(self.pin_stiffness_N_per_m, self.pin_damping_Ns_per_m)

    @property
    def has_rigid_crossings(self) -> bool:
        """Whether the strands of a crossing share its vertex."""
        return self.pins == "shared"

    def for_mjcf(self, body: WormBody) -> tuple[Self, str]:
        """Returns the section with one stiffness for a rod, as `FormulationKind.for_mjcf`."""
        if self.curvature == "constant" or body.mesh.elements_per_side == 1:
            return self, ""
        return self.model_copy(update={"curvature": "constant"}), (
            "a rod in MJCF is equally stiff at every vertex, so the worm is written with body.formulation.curvature = "
            "'constant': with two elements a side its segments elongate by 7 % less than in annelid, with six by 1 %"
        )

    def build_cost(self, n_elements: int, n_helices: int) -> tuple[float, float]:
        """Estimates time, s, and memory, GB; measured on one core: the factorisation fills with the helices."""
        return 1e-8 * n_elements**2 * n_helices, 2e-6 * n_elements * n_helices

    def check_body(self, body: WormBody) -> None:
        """Checks that stiffness differs with the material's damping only, and that steps of second order have it."""
        strands = body.strands
        if strands.stiffness_differs and strands.material_damping_s is None:
            raise ValueError(
                "body.strands.damping_time_s = none: must be given for rods whose stiffness differs, since the engine "
                "damps a rod in proportion to its stiffness"
            )
        if self.integrator == "BDF2" and not strands.material_damping_s:
            raise ValueError(
                "body.formulation.integrator = 'BDF2': must be 'Euler' where body.strands gives no damping of the "
                "material (damping_time_s, or loss_factor with loss_frequency_Hz), without which vibrations would grow"
            )

    def findings(self, config: RunConfig) -> Iterator[Finding]:
        """Checks the step against the edges and the material's damping."""
        from annelid.body.worm import WormBody

        body, step = config.body, config.clock.physics_timestep_s
        assert isinstance(body, WormBody)
        field, time_s = "clock.physics_timestep_s", body.strands.material_damping_s or 0.0
        second_order = config.arena is not None and self.engine_share(config.arena) < 1.0
        most = 0.06 if second_order else 0.04
        if step > most:
            problem = f"rods are measured up to {most:g} s, where their edges stretch by 3 %"
            yield Finding(field, step, problem, f"set at most {most:g}")
        if 0.0 < time_s < 2.0 * step:
            problem = f"the step damps rods as one to two steps more of damping time do, and they have {time_s:g} s"
            if second_order:
                problem = f"steps above half the material's damping time, {time_s:g} s, are little tried: rods may fail"
            yield Finding(field, step, problem, f"set at most {time_s / 5:.1g}")

    def add(
        self, spec: mujoco.MjSpec, geometry: MeshGeometry, body: WormBody, arena: ArenaKind, *, for_plant: bool
    ) -> None:
        """Adds the mesh as a net of rods, whose vertices touch in any case."""
        from annelid.body.formulations.rods.net import add_rods

        add_rods(spec, geometry, body, self, arena, dampers=for_plant)

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
