"""The fast formulation: elastic rods."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field

from annelid.body.formulations import BDF2_SHARE, CREEPS, FIRM_FRICTION, FormulationKind, Tie
from annelid.body.mesh import MeshBody
from annelid.config.answers import Finding
from annelid.config.run import ArenaKind, RunConfig
from annelid.config.sections import Positive
from annelid.morphology import MeshGeometry

if TYPE_CHECKING:
    import mujoco

    from annelid.body.mechanics import Mechanics


class Rods(FormulationKind):
    """The fast formulation: elastic rods, which share one vertex at each crossing unless pins are separate."""

    cites: ClassVar[tuple[tuple[str, str], ...]] = (("bergou2008", "the rods of the mesh"),)
    step_cost_ms: ClassVar[float] = 4.5
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

    def build_cost(self, n_elements: int, n_helices: int) -> tuple[float, float]:
        """Estimates time, s, and memory, GB; measured on one core: the factorisation fills with the helices."""
        return 1e-8 * n_elements**2 * n_helices, 2e-6 * n_elements * n_helices

    def findings(self, config: RunConfig) -> Iterator[Finding]:
        """Checks the step against the edges, and the friction on a slope."""
        step = config.clock.physics_timestep_s
        field, most = "clock.physics_timestep_s", 0.06
        if step > most:
            problem = f"rods were tested in steps up to {most:g} s only, in which their edges stretch by 3 %"
            yield Finding(field, step, problem, f"set at most {most:g}")
        field, ratio = "body.formulation.friction_impedance_ratio", self.friction_impedance_ratio
        if ratio < FIRM_FRICTION and config.arena is not None and config.arena.slope_rad:
            yield Finding(field, ratio, CREEPS, "set 1000")

    def add(
        self, spec: mujoco.MjSpec, geometry: MeshGeometry, body: MeshBody, arena: ArenaKind, *, for_plant: bool
    ) -> None:
        """Adds the mesh as a net of rods, whose vertices touch in any case."""
        import mujoco

        from annelid.body.formulations.rods.net import add_rods

        spec.option.impratio, spec.option.cone = self.friction_impedance_ratio, mujoco.mjtCone.mjCONE_ELLIPTIC
        add_rods(spec, geometry, body, arena, self.edge_time_constant_s, self.tie, for_plant=for_plant)

    def mechanics(
        self, model: mujoco.MjModel, data: mujoco.MjData, body: MeshBody, arena: ArenaKind, step_s: float
    ) -> Mechanics:
        """Returns what steps rods, as `FormulationKind.mechanics`."""
        from annelid.body.formulations.rods.mechanics import RodMechanics

        first_order = self.engine_share(arena) == 1.0
        return RodMechanics(model, data, body, self.tie, step_s, first_order=first_order)
