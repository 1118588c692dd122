"""What is drawn of one instant: lines and arrows as small arrays, with their colours. Pure functions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from annelid.arena.geoms import SCENE
from annelid.body.formulations.rods.net import STRAND_RGBA
from annelid.config import RunConfig
from annelid.draw.canvas import CONTRACTED, RELAXED
from annelid.draw.scene import Skeleton
from annelid.live.history import Moment
from annelid.morphology import Array
from annelid.simulation.anatomy import Anatomy

Lines = NDArray[np.float32]  # ends of line segments, m, ``(n, 2, 3)``
Colors = NDArray[np.uint8]  # red, green and blue at these ends, ``(n, 2, 3)``

STRAND_COLORS = tuple(rgba[:3] for rgba in STRAND_RGBA)  # of the two handednesses, as in stills
SPRING_COLORS = ((0.45, 0.20, 0.70), (0.80, 0.74, 0.60), (0.95, 0.50, 0.05))
"""Of an axial spring at most shortened, at rest, and at most stretched."""
SPRING_RANGE = 0.3  # strain at which these colours are full
CONTACT_COLOR = (0.04, 0.45, 0.14)
SCREEN_GAMMA = 2.2
REACH_M = 0.04
"""Distance from the line of sight within which a point of the mesh is hit; its meshes are wider than a mouse."""
EARTH_M_PER_S2 = 9.81
LONGEST_ARROW = 4.0  # of the arrows of contact forces, in radii of the worm at rest


@dataclass(frozen=True, slots=True)
class Picture:
    """One instant, ready to draw, in the model's axes."""

    strands: Lines  # pieces of the curves of all strands; their colours never change
    rings: Lines  # ring muscles from crossing to crossing
    ring_colors: Colors  # grey at rest, red where activated
    springs: Lines
    spring_colors: Colors  # by their strain
    contacts: Lines  # arrows of the ground's force on every segment, from where it pushes most
    middle: Array  # of the worm, (3,)


class Painter:
    """Turns the moments of one worm into pictures.

    Attributes:
        model: The compiled worm.
        arrow_N: Contact force whose arrow is as long as the worm's radius at rest, about two segments' weight, N.
        radius_m: That radius.
        weight_N: Of the worm on Earth.
        colored: What has the colour of the activation, where it is not a worm's rings.
        prefix: What the names of the geoms that are drawn begin with: those of a scene.
    """

    colored, prefix = "", SCENE

    def __init__(self, anatomy: Anatomy, config: RunConfig, grain_m: float = 0.0) -> None:
        """Takes the worm, and what places are rounded to, so that they compress."""
        self._skeleton, self._grain_m = Skeleton(anatomy), grain_m
        self.model, self._geometry = anatomy.model, anatomy.geometry
        path = anatomy.ring_path
        self._ring_pairs = np.stack([path[:, :-1], path[:, 1:]], axis=-1).reshape(-1, 2)
        self._corners = path.shape[1] - 1
        assert config.arena is not None
        self.radius_m, self.weight_N = self._geometry.radius_m, round(EARTH_M_PER_S2 * anatomy.total_mass_kg, 1)
        share = anatomy.total_mass_kg * config.arena.gravity_m_per_s2 / anatomy.n_segments
        self.arrow_N = float(f"{2.0 * share:.1g}") if share > 0 else 1.0

    def strand_colors(self) -> Colors:
        """Colours of all pieces, one for either handedness."""
        strands, _ = self._skeleton.locate(self.model.qpos0)
        handed = np.arange(len(strands)) // self._geometry.n_per_plane
        colors = np.asarray(STRAND_COLORS)[handed]
        return _bytes(np.repeat(colors, 2 * (strands.shape[1] - 1), axis=0)).reshape(-1, 2, 3)

    def paint(self, moment: Moment) -> Picture:
        """Draws one moment."""
        curves, crossing = self._skeleton.locate(moment.qpos)
        springs = crossing[self._geometry.springs]
        length = np.linalg.norm(springs[:, 1] - springs[:, 0], axis=-1)
        return Picture(
            strands=self._lines(np.stack([curves[:, :-1], curves[:, 1:]], axis=2).reshape(-1, 2, 3)),
            rings=self._lines(crossing[self._ring_pairs]),
            ring_colors=ring_colors(moment.activation, self._corners),
            springs=self._lines(springs),
            spring_colors=spring_colors(length / self._geometry.spring_length_m - 1.0),
            contacts=self._arrows(moment.contact_force_N, crossing),
            middle=crossing.mean(axis=0),
        )

    def places(self, geoms: NDArray[np.int64]) -> tuple[Array, Array]:
        """Returns where geoms are in the moment painted last: centres, m, ``(n, 3)``, and quaternions, ``(n, 4)``."""
        return self._skeleton.places(geoms)

    def _arrows(self, force_N: NDArray[np.floating], crossing: Array) -> Lines:
        """Arrows from the crossing of each ring that lies farthest against the force."""
        rings = crossing[self._geometry.rings]
        from_centre = rings - rings.mean(axis=1, keepdims=True)
        against = -np.einsum("sci,si->sc", from_centre, force_N)
        foot = rings[np.arange(len(rings)), against.argmax(axis=1)]
        reach = self._geometry.radius_m * force_N / self.arrow_N
        length = np.linalg.norm(reach, axis=-1, keepdims=True)
        longest = LONGEST_ARROW * self._geometry.radius_m
        reach = reach * np.minimum(1.0, longest / np.maximum(length, longest * 1e-9))
        return self._lines(np.stack([foot, foot + reach], axis=1))

    def _lines(self, points_m: Array) -> Lines:
        lines = points_m.astype(np.float32)
        return (np.round(lines / self._grain_m) * self._grain_m).astype(np.float32) if self._grain_m else lines


class PlanarPainter:
    """Turns the moments of a planar body into pictures: the sides of its segments, which its activation colours.

    Attributes:
        model: None: there is nothing of the engine to show.
        arrow_N: Contact force whose arrow is as long as `radius_m`, N.
        radius_m: Half the height of the body at first.
        weight_N: None: it cannot be poked.
        colored: What has the colour of the activation.
    """

    model = weight_N = None
    colored = "sides of a segment, activation 0 to 1"
    arrow_N = 1.0

    def __init__(self, first: Moment, grain_m: float = 0.0) -> None:
        """Takes the first moment, and what places are rounded to."""
        self._shape, self._grain_m = first.qpos.shape, grain_m
        self.radius_m = float(np.ptp(first.qpos[..., 1])) / 2

    def strand_colors(self) -> Colors:
        """Colours of all sides."""
        n_segments, n_corners, _ = self._shape
        return _bytes(np.broadcast_to(STRAND_COLORS[0], (n_segments * n_corners, 2, 3)))

    def paint(self, moment: Moment) -> Picture:
        """Draws one moment."""
        corners = np.insert(moment.qpos.astype(float), 1, 0.0, axis=-1)
        sides = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2, 3)
        lines = (np.round(sides / self._grain_m) * self._grain_m if self._grain_m else sides).astype(np.float32)
        foot = corners[np.arange(len(corners)), corners[..., 2].argmin(axis=1)]
        arrows = np.stack([foot, foot + self.radius_m * moment.contact_force_N / self.arrow_N], axis=1)
        # A body without springs still has a line for each, of no length.
        middles = corners.mean(axis=1)
        return Picture(
            strands=lines,
            rings=lines,
            ring_colors=ring_colors(moment.activation, self._shape[1]),
            springs=np.stack([middles, middles], axis=1).astype(np.float32),
            spring_colors=spring_colors(np.zeros(len(middles))),
            contacts=arrows.astype(np.float32),
            middle=middles.mean(axis=0),
        )


def ring_colors(activation: NDArray[np.floating], n_corners: int) -> Colors:
    """Colours of every line of the rings, ``n_corners`` each, grey at activation 0 and red at 1, ``(n_muscles,)``."""
    share = np.clip(activation, 0.0, 1.0)[:, np.newaxis]
    relaxed, contracted = np.asarray(RELAXED), np.asarray(CONTRACTED)
    return _bytes(np.repeat(relaxed + share * (contracted - relaxed), 2 * n_corners, axis=0)).reshape(-1, 2, 3)


def spring_colors(strain: NDArray[np.floating]) -> Colors:
    """Colours of axial springs by their strain, ``(n_springs,)``: violet if shortened, orange if stretched."""
    stops = (-SPRING_RANGE, 0.0, SPRING_RANGE)
    colors = np.stack([np.interp(strain, stops, channel) for channel in np.transpose(SPRING_COLORS)], axis=-1)
    return _bytes(np.repeat(colors, 2, axis=0)).reshape(-1, 2, 3)


def hit_point(points_m: Array, origin_m: Array, direction: Array) -> Array | None:
    """Returns the point ``(3,)`` that a ray hits first, or None: the nearest, of ``(n, 3)``, within `REACH_M`."""
    offsets = points_m - origin_m
    depth = offsets @ direction
    beside = np.linalg.norm(offsets - depth[:, np.newaxis] * direction, axis=-1)
    hit = np.flatnonzero((beside < REACH_M) & (depth > 0))
    return points_m[hit[depth[hit].argmin()]] if hit.size else None


def _bytes(colors: NDArray[np.floating]) -> Colors:
    """Colours as the viewer takes those of lines: it adds the gamma of the screen, which ours have already."""
    return np.rint(255.0 * colors**SCREEN_GAMMA).astype(np.uint8)
