"""The paper's formulation: rigid capsules on damped elastic joints."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field

from annelid.body.estimates import rhombus_of, soft_constraint
from annelid.body.formulations import CREEPS, FormulationKind
from annelid.body.mesh import MeshBody
from annelid.config.answers import Finding
from annelid.config.run import ArenaKind, RunConfig
from annelid.config.sections import Impedance, NonNegative, Positive
from annelid.morphology import MeshGeometry

if TYPE_CHECKING:
    import mujoco

    from annelid.body.mechanics import Mechanics

_RK4_DAMPED, _RK4_SWUNG = 2.78, 2.83
"""Largest products of step and rate, or frequency, at which the explicit Runge-Kutta method is stable."""


class Chain(FormulationKind):
    """The paper's formulation: rigid capsules on damped elastic joints, with a point mass at every pin."""

    is_papers: ClassVar[bool] = True
    step_cost_ms: ClassVar[float] = 15.2
    kind: Literal["chain"] = "chain"
    armature_kg_m2: NonNegative = Field(default=0.01, description="numerical inertia of the joints")
    pin_time_constant_s: Positive = Field(default=0.02, description="solref time constant of the pin constraints")
    pin_impedance: Impedance = Field(
        default=(0.9, 0.95, 0.001), description="solimp (d0, dwidth, width) of the pin constraints"
    )

    def build_cost(self, n_elements: int, n_helices: int) -> tuple[float, float]:
        """Estimates time, s, and memory, GB; measured on one core."""
        return 2e-6 * n_elements**2, 5e-5 * n_elements

    def findings(self, config: RunConfig) -> Iterator[Finding]:
        """Checks the step against the joints', the springs' and the pins' own rates, and the ground for a slope."""
        body, step = config.body, config.clock.physics_timestep_s
        assert isinstance(body, MeshBody)
        most = _largest_step_s(body, self)
        if step > most:
            problem = f"the chain's joints and springs are unstable in steps above about {most:.2g} s"
            instead = f"set at most {most / 2:.1g}, or a larger body.formulation.armature_kg_m2"
            yield Finding("clock.physics_timestep_s", step, problem, instead)
        if self.pin_time_constant_s < 2.0 * step:
            yield soft_constraint("body.formulation.pin_time_constant_s", self.pin_time_constant_s, "pins", step)
        if config.arena is not None and config.arena.slope_rad:
            yield Finding("body.formulation.kind", self.kind, CREEPS, "take rods, as riddle2023-rods has them")

    def add(
        self, spec: mujoco.MjSpec, geometry: MeshGeometry, body: MeshBody, arena: ArenaKind, *, for_plant: bool
    ) -> None:
        """Adds the mesh as chains of capsules, which need no preparation before a step."""
        from annelid.body.formulations.chain.capsules import add_chains

        # Planes that move with the skin find spheres, not capsules.
        pin = {"solref": [self.pin_time_constant_s, 1.0], "solimp": [*self.pin_impedance, 0.5, 2.0]}
        add_chains(spec, geometry, body, arena, self.armature_kg_m2, pin, for_plant and arena.has_moving_planes)

    def mechanics(
        self, model: mujoco.MjModel, data: mujoco.MjData, body: MeshBody, arena: ArenaKind, step_s: float
    ) -> Mechanics:
        """Returns the engine's own step, as `FormulationKind.mechanics`."""
        from annelid.body.formulations.chain.capsules import ChainMechanics

        return ChainMechanics(model, data, step_s)


def _largest_step_s(body: MeshBody, formulation: Chain) -> float:
    """Largest stable step of the explicit Runge-Kutta method, s, from the joints' and the springs' own rates."""
    strands, element = body.strands, rhombus_of(body).side_m / body.mesh.elements_per_side
    density = strands.one_number("linear_density_kg_per_m")
    inertia = formulation.armature_kg_m2 + density * element**3 / 12.0
    stiffness = strands.bending_rigidity_Nm2 / element
    mass = body.pins.one_number("mass_kg")
    # Neighbouring joints act on one element: four times the rate of one at the shortest wave.
    swung = max((4.0 * stiffness / inertia) ** 0.5, (4.0 * body.springs.one_number("stiffness_N_per_m") / mass) ** 0.5)
    damped = 4.0 * strands.damping_time_s * stiffness / inertia
    return min(_RK4_SWUNG / swung, _RK4_DAMPED / damped if damped else inf)
