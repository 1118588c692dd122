"""A pipe: a centre line of straights and curves, and a bore that may change along it."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, inf, isfinite, pi, radians, sin, tan
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from annelid.arena.centre_line import AHEAD, UP, Bore, Course, Curve, Straight
from annelid.arena.kinds.floor import Slope
from annelid.arena.surface import Implicit, Level, Shape, grid_faces, lengths
from annelid.config.run import ArenaKind, RunConfig
from annelid.config.sections import NonNegative, Positive
from annelid.protocols import Array

if TYPE_CHECKING:
    import mujoco


ENTRY_RAMP_M = 0.1
"""Length over which the entry's clearance ends, from the worm's front on."""
ROUNDING_M = 0.02
"""Length over which the bore's slope changes where a taper begins or ends."""
PIPE_ABOVE_FLOOR_M = 0.02
"""The floor below a pipe is there to be seen only."""
ENTRY_SHOWN_M, EXIT_SHOWN_M = 0.15, 1.2
"""How much is drawn of what goes on for ever: behind the worm's rear, and beyond the last change."""
GRAIN_M, AROUND = 0.03, 48
"""Of the triangles that are drawn: their length, and how many edges are round the pipe."""
PANEL_LENGTH_M, PANELS_AROUND = 0.05, 32
HALF_THICKNESS_M = 0.01


class Pipe(ArenaKind):
    """A pipe: a centre line of straights and curves, and a bore that may change along it.

    The worm starts inside the entry, which goes on behind it; the exit goes on too. The bore's lowest line at the entry
    is that of the mesh. Lengths along the pipe count from the worm's front.
    """

    cites: ClassVar[tuple[tuple[str, str], ...]] = (("riddle2025models", "pipes"),)
    is_closed: ClassVar[bool] = True
    kind: Literal["pipe"] = "pipe"
    bore_m: Positive = Field(default=0.16, description="radius of the bore, free for the worm's skin")
    entry_clearance_m: NonNegative = Field(
        default=0.003, description="how much wider the bore is where the worm starts, so that its strands fit in"
    )
    course: Literal["straight", "bend", "s", "helix"] = Field(
        default="straight", description="the centre line: one bend, two opposite ones, or a rising helix"
    )
    straight_m: NonNegative = Field(default=0.2, description="straight pipe between the worm's front and the curve")
    radius_m: Positive = Field(default=0.5, description="radius of the centre line's curves")
    turn_deg: Annotated[float, Field(ge=-3600, le=3600)] = Field(
        default=90.0, description="angle of each curve (helix: of the whole), positive to the worm's left"
    )
    pitch_m: NonNegative = Field(default=0.5, description="rise of the helix in a turn")
    profile: Literal["even", "taper", "hourglass"] = Field(
        default="even", description="the bore along the pipe: the same, narrowing for good, or narrowest midway"
    )
    narrowest_m: Positive = Field(default=0.13, description="radius of the narrowest bore of a taper or an hourglass")
    profile_start_m: NonNegative = Field(default=0.2, description="where the bore begins to narrow")
    profile_length_m: Positive = Field(default=0.5, description="length over which it changes")
    slope_deg: Slope = 0.0

    @model_validator(mode="after")
    def _a_pipe_that_can_be(self) -> Self:
        def refuse(field: str, problem: str) -> None:
            raise ValueError(f"arena.{field} = {getattr(self, field):g}: {problem}")

        if self.profile != "even" and self.narrowest_m >= self.bore_m:
            refuse("narrowest_m", f"must be less than arena.bore_m = {self.bore_m:g}")
        widest, turn_deg = self.bore_m + self.entry_clearance_m, abs(self.turn_deg)
        if self.course == "bend" and turn_deg > 180:
            refuse("turn_deg", "a bend must be in -180 .. 180; a helix may go on")
        if self.course == "s" and turn_deg > 135:
            refuse("turn_deg", "each curve of an s must be in -135 .. 135")
        if self.course in ("bend", "s") and turn_deg > 135 and self.radius_m <= widest:
            refuse("radius_m", f"must be more than {widest:g}, or the legs of the bend overlap")
        if self.course == "helix" and self.radius_m <= widest:
            refuse("radius_m", f"must be more than {widest:g} for a helix, or the pipe overlaps itself")
        if self.course == "helix" and turn_deg > 270 and self.pitch_m <= 2.2 * widest:
            refuse("pitch_m", f"must be more than {2.2 * widest:g} for turns that lie above each other")
        return self

    @property
    def floor_depth_m(self) -> float:
        """Of a floor that is there to be seen only."""
        return PIPE_ABOVE_FLOOR_M

    def check_with(self, config: RunConfig) -> None:
        """Checks that the worm fits into its entry."""
        free, mesh = self.bore_m + self.entry_clearance_m, getattr(config.body, "mesh", None)
        if mesh is not None and free < max(mesh.radii_m):
            raise ValueError(
                f"arena.bore_m = {self.bore_m:g}: with arena.entry_clearance_m = {self.entry_clearance_m:g} it must be "
                f"at least body.mesh.radius_m = {max(mesh.radii_m):g}, the worm that starts inside; make it narrower "
                "further on with arena.profile"
            )

    def ground(self) -> PipeWall:
        """Returns the inside of the wall."""
        return PipeWall(self.centre_line(), self.bore())

    def centre_line(self) -> Course:
        """Returns the centre line in the coordinates of the worm's model; arc lengths count from the worm's front."""
        start = self.bore_m * UP
        if self.course == "straight":
            return Course((Straight(start, AHEAD, -inf, inf),))
        turn = radians(self.turn_deg)
        rise = self.pitch_m / (2 * pi) if self.course == "helix" else 0.0
        curve = _curve(start + self.straight_m * AHEAD, AHEAD, UP, self.radius_m, rise, turn, self.straight_m)
        pieces: list[Straight | Curve] = [Straight(start, AHEAD, -inf, self.straight_m), curve]
        if self.course == "s":
            end = curve.at(np.array(curve.last_m))
            pieces.append(_curve(end.point_m, end.tangent, UP, self.radius_m, 0.0, -turn, curve.last_m))
        last = pieces[-1].at(np.array(pieces[-1].last_m))
        pieces.append(Straight(last.point_m, last.tangent, pieces[-1].last_m, inf))
        return Course(tuple(pieces))

    def bore(self) -> Bore:
        """Returns the bore: wider at the entry by the clearance, then as the profile says."""
        change = self.narrowest_m - self.bore_m
        parts = [_change(0.0, ENTRY_RAMP_M, -self.entry_clearance_m)]
        if self.profile != "even":
            back = self.profile == "hourglass"
            parts.append(_change(self.profile_start_m, self.profile_length_m, change, back=back))
        arc = np.unique(np.concatenate([knots for knots, _ in parts]))
        slope = sum((np.interp(arc, *part, left=0.0, right=0.0) for part in parts), np.zeros(len(arc)))
        rises = np.diff(arc) * (slope[1:] + slope[:-1]) / 2
        radius = self.bore_m + self.entry_clearance_m + np.concatenate([[0.0], np.cumsum(rises)])
        return Bore(arc, slope, radius)

    def reach_m(self) -> tuple[float, float]:
        """Returns where the pipe bends or changes its bore; both 0 for a plain straight one."""
        joints = self.centre_line().joints_m
        parts = [(joints[0], joints[-1])] if joints else []
        if self.profile != "even":
            parts.append((self.profile_start_m, self.profile_start_m + self.profile_length_m))
        return (min(first for first, _ in parts), max(last for _, last in parts)) if parts else (0.0, 0.0)

    def shape(self, length_m: float) -> Shape:
        """Returns the tube to be drawn."""
        wall, (first, last) = self.ground(), self._shown(length_m)
        arc = np.linspace(first, last, int((last - first) / GRAIN_M) + 2)
        centre, side, up = frames_along(wall.course, arc)
        angle = np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False)
        across = np.cos(angle)[:, np.newaxis] * side[:, np.newaxis] + np.sin(angle)[:, np.newaxis] * up[:, np.newaxis]
        rings = centre[:, np.newaxis] + wall.bore.at(arc)[0][:, np.newaxis, np.newaxis] * across
        return Shape(rings.reshape(-1, 3), grid_faces(len(arc), AROUND, closed=True))

    def add_panels(self, spec: mujoco.MjSpec, length_m: float) -> None:
        """Adds flat panels that are tangent to the wall in their middles; none is drawn."""
        from annelid.arena.geoms import add_box

        wall, (first, last) = self.ground(), self._shown(length_m)
        n_rings = int((last - first) / PANEL_LENGTH_M) + 1
        arc = first + (np.arange(n_rings) + 0.5) * (last - first) / n_rings
        centre, side, up = frames_along(wall.course, arc)
        foot, radius = wall.course.at(arc), wall.bore.at(arc)[0]
        for angle in 2.0 * pi * np.arange(PANELS_AROUND) / PANELS_AROUND:
            outwards = np.cos(angle) * side + np.sin(angle) * up
            # A ring's panels are longer on the outer side of a curve.
            stretch = 1.0 - radius * (outwards * foot.curvature_per_m).sum(axis=-1)
            places = centre + radius[:, np.newaxis] * outwards
            inwards = wall.normal(places)
            half_length = np.maximum(stretch, 0.1) * (last - first) / n_rings / 2
            for place, facing, along, half, own in zip(places, inwards, foot.tangent, half_length, radius, strict=True):
                ahead = along - (along @ facing) * facing
                ahead = ahead / np.linalg.norm(ahead)
                axes = np.stack([ahead, np.cross(facing, ahead), facing], axis=-1)
                size = [half, own * tan(pi / PANELS_AROUND), HALF_THICKNESS_M]
                add_box(spec, self, place - HALF_THICKNESS_M * facing, size, axes)

    def _shown(self, length_m: float) -> tuple[float, float]:
        """Arc lengths between which the pipe is drawn, m, with a worm of a length in its entry."""
        ends = [piece.first_m for piece in self.centre_line().pieces if isinstance(piece, Straight)]
        last = max([*filter(isfinite, ends), float(self.bore().arc_m[-1])])
        return -(length_m + ENTRY_SHOWN_M), last + EXIT_SHOWN_M


def _curve(start: Array, tangent: Array, up: Array, radius: float, rise: float, turn_rad: float, arc_m: float) -> Curve:
    """Joins a curve smoothly to what ends at a point; the axis of a helix leans so far that its start is level."""
    outwards = np.sign(turn_rad) * np.cross(tangent, up)
    lean = atan2(rise, radius)
    onwards, axis = cos(lean) * tangent - sin(lean) * up, sin(lean) * tangent + cos(lean) * up
    return Curve(start - radius * outwards, outwards, onwards, axis, radius, rise, abs(turn_rad), arc_m)


def _change(start: float, length: float, change: float, *, back: bool = False) -> tuple[Array, Array]:
    """Arc lengths and slopes of a change of the radius with rounded ends: an even one, or a parabola there and back."""
    rounding = min(ROUNDING_M, length / 4)
    slope = 4.0 * change / length if back else change / (length - rounding)
    knots = np.array([start, start + rounding, start + length - rounding, start + length])
    return knots, np.array([0.0, slope, -slope if back else slope, 0.0])


@dataclass(frozen=True)
class PipeWall(Implicit):
    """The inside of a pipe: its centre line, and its radius along that."""

    course: Course
    bore: Bore

    def level(self, points_m: Array) -> Level:
        """Returns how far points lie within the bore's radius at the nearest point of the centre line, m."""
        foot = self.course.nearest(points_m)
        away = points_m - foot.point_m
        radial = lengths(away)
        on_line = radial == 0.0
        outwards = np.where(on_line[:, np.newaxis], UP, away / np.where(on_line, 1.0, radial)[:, np.newaxis])
        radius, slope = self.bore.at(foot.arc_m)
        # The centre line's arc length grows faster than the path on the inner side of a curve.
        stretch = np.maximum(1.0 - (away * foot.curvature_per_m).sum(axis=-1), 0.1)
        gradient = (slope / stretch)[:, np.newaxis] * foot.tangent - outwards
        return Level(radius - radial, gradient, slope == 0.0)


def frames_along(course: Course, arc_m: Array) -> tuple[Array, Array, Array]:
    """Returns the centre line's points at arc lengths and two unit vectors across it, ``(n, 3)`` each.

    The second one points as far upwards as it can, so the rings drawn with them are not twisted.
    """
    foot = course.at(arc_m)
    side: Array = np.cross(foot.tangent, UP)
    side = side / np.linalg.norm(side, axis=-1, keepdims=True)
    up: Array = np.cross(side, foot.tangent)
    return foot.point_m, side, up
