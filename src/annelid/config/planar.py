"""The planar worms' bodies."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from annelid.config.sections import NonNegative, Positive, Section


class PlanarWorm(Section):
    """What every planar worm has: its segments are rhombi in a row."""

    n_segments: Annotated[int, Field(ge=3, le=200)] = Field(default=3, description="actuated segments")


class PlanarBody(PlanarWorm):
    """The kinematic planar worm of Riddle 2022: rhombi with rigid sides and speed-limited actuators."""

    kind: Literal["riddle2022"] = "riddle2022"
    side_m: Positive = Field(default=0.073, description="side of a rhombus")
    height_min_m: Positive = Field(default=0.065, description="height when contracted")
    height_max_m: Positive = Field(default=0.11, description="height when relaxed")
    gain: Positive = Field(
        default=1.3, description="proportional gain k of the actuator; 1.3, 1.9, 3.6 for 300, 200, 100 ms"
    )

    @model_validator(mode="after")
    def _heights_fit_the_rhombus(self) -> Self:
        if not self.height_min_m < self.height_max_m < 2 * self.side_m:
            raise ValueError(
                f"body.height_min_m = {self.height_min_m:g} and body.height_max_m = {self.height_max_m:g} must satisfy "
                f"height_min_m < height_max_m < 2 side_m = {2 * self.side_m:g}"
            )
        return self


class DynamicPlanarWorm(PlanarWorm):
    """What the planar worms with masses and forces share; no paper in hand states these constants.

    They are those of a light robot of the size of Riddle 2022's: sides and heights are that worm's, spring and muscle
    balance near its contracted height, the damper gives its time constant of about 0.1 s.
    """

    side_m: Positive = Field(default=0.073, description="side of a rhombus")
    height_relaxed_m: Positive = Field(default=0.11, description="height at which the return spring is slack")
    height_shortest_m: Positive = Field(default=0.055, description="height at which a muscle's force has fallen to 0")
    joint_mass_kg: Positive = Field(default=0.05, description="mass of a joint on the axis")
    vertex_mass_kg: Positive = Field(default=0.05, description="mass of an upper or a lower vertex")
    spring_stiffness_N_per_m: Positive = Field(default=200.0, description="return spring along a segment")
    muscle_force_N: NonNegative = Field(default=19.0, description="of a fully active muscle at the relaxed height")
    height_damping_Ns_per_m: NonNegative = Field(
        default=35.0, description="viscous resistance to a change of a segment's height"
    )

    @model_validator(mode="after")
    def _heights_fit_the_rhombus(self) -> Self:
        if not self.height_shortest_m < self.height_relaxed_m < 2 * self.side_m:
            raise ValueError(
                f"body.height_shortest_m = {self.height_shortest_m:g} and body.height_relaxed_m = "
                f"{self.height_relaxed_m:g} must satisfy height_shortest_m < height_relaxed_m < 2 side_m = "
                f"{2 * self.side_m:g}"
            )
        return self


class Daltorio2013Body(DynamicPlanarWorm):
    """The planar worm of Daltorio 2013: rigid-sided rhombi, torsional springs between them, and the walls of a pipe."""

    kind: Literal["daltorio2013"] = "daltorio2013"
    torsion_stiffness_Nm_per_rad: NonNegative = Field(
        default=0.2, description="torsional springs between neighbouring segments"
    )
    torsion_damping_Nms_per_rad: NonNegative = Field(default=0.0, description="viscous resistance beside them")
    pipe_diameter_m: Positive = Field(default=0.1, description="distance of the walls from one another")
    wall_stiffness_N_per_m: Positive = Field(default=2000.0, description="force per indentation at one vertex")
    wall_friction: NonNegative = Field(default=0.5, description="coefficient of Coulomb friction with the walls")

    @model_validator(mode="after")
    def _the_worm_can_leave_the_wall(self) -> Self:
        if self.pipe_diameter_m <= self.height_shortest_m:
            raise ValueError(
                f"body.pipe_diameter_m = {self.pipe_diameter_m:g} must be greater than body.height_shortest_m = "
                f"{self.height_shortest_m:g}"
            )
        return self


class Boxerbaum2012Body(DynamicPlanarWorm):
    """The planar worm of Boxerbaum 2012: rhombi whose sides bend in their middle, without ground."""

    kind: Literal["boxerbaum2012"] = "boxerbaum2012"
    middle_mass_kg: Positive = Field(default=0.02, description="mass of the middle of a side")
    torsion_stiffness_Nm_per_rad: Positive = Field(default=0.2, description="torsional spring in the middle of a side")
    torsion_damping_Nms_per_rad: NonNegative = Field(default=0.01, description="viscous resistance beside it")
