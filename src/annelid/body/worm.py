"""The 3D worm's body: a mesh with any kind of ring actuators and formulation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from math import log, sqrt
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self, cast

from pydantic import Field, model_validator

from annelid.body.actuators import ActuatorKind
from annelid.body.checks import ground_findings, material_findings, mesh_findings, tolerance_findings
from annelid.body.estimates import WALKS_FROM, rhombus_of
from annelid.body.formulations import FormulationKind
from annelid.body.mesh import MeshBody
from annelid.config.answers import Finding
from annelid.config.kinds import Choice, default_of
from annelid.config.run import RunConfig
from annelid.config.sections import Section
from annelid.errors import ConfigError, listed, shown
from annelid.protocols import Plant

if TYPE_CHECKING:
    from annelid.body.actuators.muscle import Rings

EQUAL_STIFFNESS_RADIUS_M = 0.00299
"""Radius of a solid strand that bends as the robot's tube: the authors' choice of 2025."""
ALIKE_IN_A_GROUP = ("mesh", "strands", "pins", "springs")
"""Sections that decide how much a segment resists its ring."""
LONGEST_BUILD_S = 100.0
"""Estimated time to build a body, above which it is refused, s."""


class WormBody(MeshBody):
    """Any 3D worm of helical strands, rings and springs on the ground."""

    cites: ClassVar[tuple[tuple[str, str], ...]] = (
        ("todorov2012", "the physics engine"),
        ("wang", "the robot that the 3D worm is a model of"),
    )
    needs_arena: ClassVar[bool] = True
    can_be_pushed: ClassVar[bool] = True
    has_skin: ClassVar[bool] = True
    rings: Annotated[ActuatorKind, Choice()] = Field(default_factory=lambda: default_of(ActuatorKind))
    formulation: Annotated[FormulationKind, Choice()] = Field(default_factory=lambda: default_of(FormulationKind))

    def build(self, config: RunConfig) -> Plant:
        """Builds the worm's plant, as `BodyKind.build`."""
        # The simulation is built on this module, and loads the engine.
        return import_module("annelid.simulation.worm").WormPlant(config)

    def refuse_fidelity(self, level: str) -> None:
        """Refuses a level unless strands share their crossings, as those with which its errors were measured."""
        if not self.has_rigid_crossings:
            raise ConfigError(
                f"fidelity = {level!r} is measured for rods that share their pins (body.formulation.kind = 'rods', "
                "body.formulation.pins = 'shared'): set body.mesh.elements_per_side and clock.physics_timestep_s, or "
                "take the preset riddle2023-rods"
            )

    @property
    def has_halves(self) -> bool:
        """Whether its rings are halved."""
        return self.rings.layout == "halves"

    @property
    def is_papers(self) -> bool:
        """As its formulation."""
        return self.formulation.is_papers

    @property
    def has_rigid_crossings(self) -> bool:
        """As its formulation."""
        return self.formulation.has_rigid_crossings

    @property
    def step_cost_ms(self) -> float:
        """About how long a physics step takes, ms: in proportion to segments and elements."""
        return self.mesh.n_segments / 3 * self.mesh.elements_per_side / 3 * self.formulation.step_cost_ms

    def findings(self, config: RunConfig) -> Iterator[Finding]:
        """Checks lengths, forces, steps and tolerances against one another, each group of like segments by itself."""
        assert config.arena is not None
        groups, window = self.groups(), self.tolerance_window_m(config.arena.friction)
        for segments, alike in groups:
            alone = config.model_copy(update={"body": alike})
            found = [*mesh_findings(alike), *alike.rings.findings(alike), *material_findings(alike)]
            found += [*alike.formulation.findings(alone), *ground_findings(alone, alike, alike.rings.forces(1)[0])]
            of = f"segment {listed(str(segment + 1) for segment in segments)}: " if len(groups) > 1 else ""
            yield from (replace(one, problem=of + one.problem) for one in found)
            found = tolerance_findings(config, alike, window, lags=alike.rings.lags)
            yield from (replace(one, problem=of + one.problem) for one in found)

    def tolerance_window_m(self, friction: float) -> tuple[float, float] | None:
        """Estimates between which tolerances of the stretch sensors the paper's controller walks in order, m.

        Below, contracting neighbours lift a segment at rest out of its tolerance. Above, a segment that lets go is
        back within it before the next has left it: all sensors say "at rest", and nothing contracts again. The middle
        of both is the tolerance to set. Both lengths are fitted to the paper's robot of rods under a timed wave, with
        moduli of 0.3 to 2 GPa, friction of 0.05 to 1 and damping times of 0.05 to 0.36 s, within 7 and 4 mm, with
        muscles that lag behind their commands by the engine's times. Under the paper's network the worm walks with
        three quarters of the lift and more (docs/evidence/robust.md). The stiffness enters as ``sqrt(EI / (k s^3))``,
        with the springs' rate k and the side s of a rhombus: stiffer strands spread a contraction.

        Args:
            friction: Coefficient of the ground.

        Returns:
            `WALKS_FROM` of how far neighbours lift a segment, and the length beyond rest at which the releasing and the
            next segment are equally long; where the first is the larger, no tolerance is known to do. None for bodies
            that were not measured: other than rods with rigid crossings, with a damping time of 0.05 to 0.4 s, muscles
            all round that lag, springs that are at rest as drawn, and segments that are alike.
        """
        if len(self.groups()) > 1:
            return None
        damping_s, rings, rate = self.strands.damping_time_s, self.rings, self.springs.one_number("stiffness_N_per_m")
        measured = self.has_rigid_crossings and rings.lags and not self.has_halves
        # Beyond what was measured the lines that were fitted say nothing.
        if not measured or self.springs.rest_length_m is not None or not rate or not 0.05 <= damping_s <= 0.4:
            return None
        shape = rhombus_of(self)
        spread = sqrt(self.strands.bending_rigidity_Nm2 / (rate * shape.side_m**3))
        slippery = log(1.0 / min(max(friction, 0.05), 1.0))
        most = shape.longest_m - shape.along_m
        lift = 0.388 * spread + 0.951 * damping_s + 0.008 * slippery - 0.179
        return most * max(0.02, WALKS_FROM * lift), most * 0.554

    def groups(self) -> list[tuple[list[int], Self]]:
        """Groups the segments whose mesh, strands, pins and springs are alike.

        Returns:
            The segments of every group, counted from 0, and the body as if all segments were as these, with the lengths
            and forces of their rings alone. So those sections have one number where they may have one per segment.
        """
        parts: dict[str, Section] = {name: getattr(self, name) for name in ALIKE_IN_A_GROUP}
        n, groups = self.n_segments, dict[tuple[float, ...], list[int]]()
        of_each = [part.of_each(name, n) for part in parts.values() for name in part.segment_fields]
        for segment, numbers in enumerate(zip(*of_each, strict=True)):
            groups.setdefault(numbers, []).append(segment)
        rings = {} if len(groups) == 1 else {tuple(own): self.rings.of_segments(own, n) for own in groups.values()}

        def alone(own: list[int]) -> Self:
            alike = {name: part.of_segment(own[0]) for name, part in parts.items()}
            return self.model_copy(update={**alike, "rings": rings.get(tuple(own), self.rings)})

        return [(own, alone(own)) for own in groups.values()]

    @property
    def muscles(self) -> Rings:
        """The ring muscles; `ConfigError` where the rings have actuators of another kind."""
        muscle = self.rings.muscle
        if muscle is None:
            raise ConfigError(
                f"body.rings.kind = {self.rings.kind!r} has no muscles; this needs body.rings.kind = 'muscle'"
            )
        return cast("Rings", muscle)

    def cited(self) -> tuple[tuple[str, str], ...]:
        """Returns the engine and the robot, and what formulation, strands and actuators rest on."""
        strands: tuple[tuple[str, str], ...] = ()
        if self.strands.radius_m == EQUAL_STIFFNESS_RADIUS_M:
            strands = (
                ("riddle2025", "strands of the stiffness of the robot's tubes"),
                ("riddle2025models", "its model files"),
            )
        return (*self.cites, *self.formulation.cited(), *strands, *self.rings.cited())

    def _fields_per_segment(self) -> Iterator[tuple[str, Section, str]]:
        """Yields every field that takes one number per segment: path and section that have it, and its name."""
        for part in ALIKE_IN_A_GROUP:
            section: Section = getattr(self, part)
            yield from ((f"body.{part}", section, name) for name in section.segment_fields)
        yield "body.rings", self.rings, self.rings.force_field

    @model_validator(mode="after")
    def _can_be_built(self) -> Self:
        mesh = self.mesh
        planes = mesh.planes_between_rings * (mesh.n_segments - 1) + 2 * mesh.free_planes_at_ends
        at_ends = 2 * (mesh.elements_per_end or mesh.elements_per_side)
        elements = mesh.n_helices * (mesh.elements_per_side * planes + at_ends)
        time_s, memory_GB = self.formulation.build_cost(elements, mesh.n_helices)
        if time_s > LONGEST_BUILD_S:
            raise ValueError(
                f"body.mesh.n_segments = {mesh.n_segments}, body.mesh.n_helices = {mesh.n_helices} and "
                f"body.mesh.elements_per_side = {mesh.elements_per_side} make {elements:,} elements. They take "
                f"{time_s:,.0f} s and {memory_GB:,.1f} GB to build, and {LONGEST_BUILD_S:g} s are allowed: lower one "
                "of them"
            )
        return self

    @model_validator(mode="after")
    def _parts_fit_together(self) -> Self:
        mesh, rings, n = self.mesh, self.rings, self.mesh.n_segments
        for path, section, name in self._fields_per_segment():
            if (given := len(section.of_each(name, n))) != n:
                raise ValueError(
                    f"{path}.{name} = {shown(list(getattr(section, name)))} has {given} numbers for {n} segments: "
                    f"give a number, or {n} numbers, one per segment"
                )
        if self.strands.radius_m >= min(mesh.radii_m):
            raise ValueError(
                f"body.strands.radius_m = {self.strands.radius_m:g} must be less than body.mesh.radius_m = "
                f"{min(mesh.radii_m):g}"
            )
        if self.has_halves and mesh.n_helices % 4:
            raise ValueError(
                "body.rings.layout = 'halves' needs body.mesh.n_helices to be a multiple of 4, "
                f"not {mesh.n_helices}: equal halves need an even number of crossings round a ring"
            )
        if (given := len(rings.length_ranges(n))) != n:
            raise ValueError(
                f"body.rings.length_range_m gives {given} ranges for {n} segments: "
                "give one pair for each, or one for all, for example body.rings.length_range_m=[0.566,1.067]"
            )
        return self


class HelicalWorm(WormBody):
    """The 3D worm."""

    kind: Literal["worm"] = "worm"


def worm_of(config: RunConfig) -> WormBody:
    """Returns the body of a configuration, which must be a 3D worm.

    Args:
        config: The configuration.

    Raises:
        ConfigError: It is another body, without strands, rings and springs.
    """
    if not isinstance(config.body, WormBody):
        raise ConfigError(
            f"body.kind = {config.body.kind!r} has no strands, rings and springs: this needs the 3D worm "
            "(body.kind = 'worm'). A planar body sets is_planar = True and has a method outlines(values)"
        )
    return config.body
