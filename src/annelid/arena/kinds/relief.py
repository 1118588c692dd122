"""Floors whose relief begins in front of the worm: a flight of steps, and rough ground."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from annelid.arena.kinds.floor import Ground
from annelid.arena.shapes import (
    GROUND_AHEAD_M,
    GROUND_BEHIND_M,
    GROUND_GRAIN_M,
    GROUND_HALF_WIDTH_M,
    ROUNDED_GRAIN,
    Shape,
    grid_faces,
)
from annelid.arena.surface import Implicit, Level, Nearest, Surface
from annelid.config.sections import NonNegative, Positive, Seed
from annelid.protocols import Array

if TYPE_CHECKING:
    import mujoco

N_WAVES = 32
"""Waves that rough ground is the sum of."""
FIELD_GRAIN_M = 0.02
FIELD_BASE_M = 0.1


class Relief(Ground):
    """A floor whose relief begins in front of the worm."""

    start_m: NonNegative = Field(default=0.1, description="level ground between the worm's front and the relief")


class Steps(Relief):
    """A flight of steps that the worm climbs."""

    kind: Literal["steps"] = "steps"
    step_height_m: Positive = Field(default=0.02, description="height of each step")
    step_length_m: Positive = Field(default=0.3, description="length of each step")
    rounding_m: Positive = Field(default=0.008, description="radius of the steps' rounded edges and inner corners")

    @model_validator(mode="after")
    def _rounded_steps_fit(self) -> Self:
        most = min(self.step_height_m, self.step_length_m) / 2
        if self.rounding_m > most:
            raise ValueError(
                f"arena.rounding_m = {self.rounding_m:g}: must be at most {most:g}, half of a step's height and length"
            )
        return self

    def ground(self) -> Surface:
        """Returns the steps."""
        return self._stairs()

    def shape(self, length_m: float) -> Shape:
        """Returns the steps to be drawn."""
        return _flight(self._stairs())

    def add_panels(self, spec: mujoco.MjSpec, length_m: float) -> None:
        """Adds a block a step."""
        _add_blocks(spec, self, self._stairs())

    def _stairs(self) -> Stairs:
        profile = StepProfile(self.start_m, self.step_length_m, self.step_height_m, self.rounding_m)
        return Stairs(profile, -self.floor_gap_m)


class Rough(Relief):
    """Rough ground: a random height with a Gaussian correlation."""

    kind: Literal["rough"] = "rough"
    roughness_m: Positive = Field(default=0.008, description="root mean square of the height")
    correlation_m: Positive = Field(default=0.15, description="distance at which heights correlate by 1/e")
    relief_seed: Seed = Field(default=0, description="seed of the random ground")

    @model_validator(mode="after")
    def _not_too_steep(self) -> Self:
        if self.roughness_m > 0.2 * self.correlation_m:
            raise ValueError(
                f"arena.roughness_m = {self.roughness_m:g}: must be at most a fifth of arena.correlation_m = "
                f"{self.correlation_m:g}, or the ground is no gentle surface"
            )
        return self

    def ground(self) -> Surface:
        """Returns the ground that `relief_seed` draws."""
        return self._hills()

    def shape(self, length_m: float) -> Shape:
        """Returns the ground to be drawn."""
        return _field(self._hills())

    def add_panels(self, spec: mujoco.MjSpec, length_m: float) -> None:
        """Adds a height field."""
        _add_field(spec, self, self._hills())

    def _hills(self) -> Hills:
        return Hills(RoughGround.drawn(self), -self.floor_gap_m)


@dataclass(frozen=True)
class StepProfile:
    """Treads and risers in a plane, with rounded edges and inner corners.

    Attributes:
        start_m: Where the first step rises, m ahead of the worm's front.
        length_m: Length of a step, m.
        height_m: Height of a step, m.
        rounding_m: Radius of edges and inner corners, m; at most half of either.
    """

    start_m: float
    length_m: float
    height_m: float
    rounding_m: float

    def nearest(self, ahead_m: Array, up_m: Array) -> tuple[Array, Array, Array]:
        """Finds the nearest points of the profile; exact within half a step's length of it.

        Args:
            ahead_m: How far points are ahead of the worm's front, m, ``(...)``.
            up_m: Their height above the ground before the steps, m, ``(...)``.

        Returns:
            Signed distances, m, positive above the steps, and the two parts of the unit normal (ahead, up), ``(...)``.
        """
        # By symmetry every point sees one riser only: the nearest, at the origin.
        step = np.maximum(np.round((ahead_m - self.start_m) / self.length_m), 0.0)
        x, z = ahead_m - self.start_m - step * self.length_m, up_m - step * self.height_m
        r, h = self.rounding_m, self.height_m
        corner, edge = np.hypot(x + r, z - r), np.hypot(x - r, z - h + r)
        parts = (
            (x <= -r, z, 0.0, 1.0),
            (x >= r, z - h, 0.0, 1.0),
            ((z >= r) & (z <= h - r), -x, -1.0, 0.0),
            ((x > -r) & (z < r), r - corner, *_shares(-x - r, r - z, corner)),
            ((x < r) & (z > h - r), edge - r, *_shares(x - r, z - h + r, edge)),
        )
        best, ahead, up = np.full(x.shape, np.inf), np.zeros(x.shape), np.ones(x.shape)
        for valid, distance, own_ahead, own_up in parts:
            nearer = valid & (np.abs(distance) < np.abs(best))
            best = np.where(nearer, distance, best)
            ahead, up = np.where(nearer, own_ahead, ahead), np.where(nearer, own_up, up)
        return best, ahead, up


def _shares(x: Array, z: Array, length: Array) -> tuple[Array, Array]:
    length = np.where(length > 0.0, length, 1.0)
    return x / length, z / length


@dataclass(frozen=True)
class RoughGround:
    """A random height, a sum of plane waves; it swells from level ground over one correlation length.

    Attributes:
        start_m: Where it begins, m ahead of the worm's front.
        swell_m: Length over which it swells to its full height, m.
        amplitude_m: Of each wave, m.
        wave_per_m: Wave vectors, 1/m, ``(n_waves, 2)``.
        phase_rad: Phases, ``(n_waves,)``.
    """

    start_m: float
    swell_m: float
    amplitude_m: float
    wave_per_m: Array
    phase_rad: Array

    @classmethod
    def drawn(cls, arena: Rough) -> Self:
        """Draws the ground of a seed; its correlation is Gaussian in the distance."""
        generator = np.random.default_rng(arena.relief_seed)
        waves = generator.normal(scale=sqrt(2.0) / arena.correlation_m, size=(N_WAVES, 2))
        phases = generator.uniform(0.0, 2.0 * np.pi, size=N_WAVES)
        return cls(arena.start_m, arena.correlation_m, arena.roughness_m * sqrt(2.0 / N_WAVES), waves, phases)

    def height(self, places_m: Array) -> tuple[Array, Array]:
        """Returns heights, m, ``(...)``, and their slopes, ``(..., 2)``, at places (x, y), m, ``(..., 2)``."""
        phase = places_m @ self.wave_per_m.T + self.phase_rad
        height = self.amplitude_m * np.cos(phase).sum(axis=-1)
        slope = -self.amplitude_m * (np.sin(phase) @ self.wave_per_m)
        share = np.clip((-places_m[..., 0] - self.start_m) / self.swell_m, 0.0, 1.0)
        # The smooth step whose first two derivatives vanish at its ends.
        swollen = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        swelling = -30.0 * share**2 * (1.0 - share) ** 2 / self.swell_m
        slope = slope * swollen[..., np.newaxis]
        slope[..., 0] += height * swelling
        return height * swollen, slope


@dataclass(frozen=True)
class Hills(Implicit):
    """Rough ground.

    Attributes:
        ground: Its height.
        level_m: Height z of the level ground before it, m.
    """

    ground: RoughGround
    level_m: float

    def level(self, points_m: Array) -> Level:
        """Returns heights above the ground straight below, m."""
        height, slope = self.ground.height(points_m[:, :2])
        gradient = np.concatenate([-slope, np.ones((len(slope), 1))], axis=-1)
        return Level(points_m[:, 2] - self.level_m - height, gradient, np.zeros(len(height), dtype=bool))


@dataclass(frozen=True)
class Stairs(Nearest):
    """A flight of steps with rounded edges.

    Attributes:
        profile: Its side view.
        level_m: Height z of the level ground before it, m.
    """

    profile: StepProfile
    level_m: float

    def nearest(self, points_m: Array, *, first_order: bool = False) -> tuple[Array, Array]:
        """Returns distance and normal of the nearest tread, riser or rounding."""
        distance, ahead, up = self.profile.nearest(-points_m[..., 0], points_m[..., 2] - self.level_m)
        return distance, np.stack([-ahead, np.zeros(ahead.shape), up], axis=-1)


def _flight(stairs: Stairs) -> Shape:
    profile = stairs.profile
    turn = np.linspace(0.0, np.pi / 2, ROUNDED_GRAIN)
    r, h = profile.rounding_m, profile.height_m
    riser = np.concatenate(
        [
            np.stack([-r + r * np.sin(turn), r - r * np.cos(turn)], axis=-1),
            np.stack([r - r * np.cos(turn), h - r + r * np.sin(turn)], axis=-1),
        ]
    )
    n_steps = max(int((GROUND_AHEAD_M - profile.start_m) / profile.length_m), 1)
    risers = [riser + np.array([profile.start_m + k * profile.length_m, k * h]) for k in range(n_steps)]
    end = [[GROUND_AHEAD_M, n_steps * h]] if n_steps * profile.length_m + profile.start_m < GROUND_AHEAD_M else []
    line = np.concatenate([[[-GROUND_BEHIND_M, 0.0]], *risers, np.reshape(end, (-1, 2))])
    across = np.linspace(-GROUND_HALF_WIDTH_M, GROUND_HALF_WIDTH_M, 9)
    x, y = np.meshgrid(-line[:, 0], across, indexing="ij")
    z = np.broadcast_to(line[:, 1:] + stairs.level_m, x.shape)
    return Shape(np.stack([x, y, z], axis=-1).reshape(-1, 3), grid_faces(*x.shape)[:, ::-1])


def _field(hills: Hills) -> Shape:
    ahead = np.arange(-GROUND_BEHIND_M, GROUND_AHEAD_M, GROUND_GRAIN_M)
    across = np.arange(-GROUND_HALF_WIDTH_M, GROUND_HALF_WIDTH_M, GROUND_GRAIN_M)
    x, y = np.meshgrid(-ahead, across, indexing="ij")
    height, _ = hills.ground.height(np.stack([x, y], axis=-1))
    return Shape(np.stack([x, y, height + hills.level_m], axis=-1).reshape(-1, 3), grid_faces(*x.shape)[:, ::-1])


def _add_blocks(spec: mujoco.MjSpec, arena: Steps, stairs: Stairs) -> None:
    from annelid.arena.contact import add_box

    profile = stairs.profile
    front, rear = -GROUND_AHEAD_M, GROUND_BEHIND_M
    bottom = stairs.level_m - FIELD_BASE_M
    n_steps = max(int((GROUND_AHEAD_M - profile.start_m) / profile.length_m), 1)
    edges = [rear, *(-profile.start_m - k * profile.length_m for k in range(n_steps))]
    for step, edge in enumerate(edges):
        top = stairs.level_m + step * profile.height_m
        place = np.array([(edge + front) / 2, 0.0, (top + bottom) / 2])
        add_box(spec, arena, place, [(edge - front) / 2, GROUND_HALF_WIDTH_M, (top - bottom) / 2], np.eye(3))


def _add_field(spec: mujoco.MjSpec, arena: Rough, hills: Hills) -> None:
    import mujoco

    from annelid.arena.contact import HIDDEN_GROUP, contact_options

    half_length = (GROUND_AHEAD_M + GROUND_BEHIND_M) / 2
    middle = (GROUND_BEHIND_M - GROUND_AHEAD_M) / 2
    columns, rows = (int(2 * half / FIELD_GRAIN_M) + 1 for half in (half_length, GROUND_HALF_WIDTH_M))
    x = middle + np.linspace(-half_length, half_length, columns)
    y = np.linspace(-GROUND_HALF_WIDTH_M, GROUND_HALF_WIDTH_M, rows)
    height, _ = hills.ground.height(np.stack(np.meshgrid(x, y), axis=-1))
    lowest, span = float(height.min()), float(np.ptp(height))
    spec.add_hfield(
        name="relief",
        nrow=rows,
        ncol=columns,
        size=[half_length, GROUND_HALF_WIDTH_M, span, FIELD_BASE_M],
        userdata=((height - lowest) / span).ravel(),
    )
    spec.worldbody.add_geom(
        name="relief",
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname="relief",
        pos=[middle, 0.0, hills.level_m + lowest],
        group=HIDDEN_GROUP,
        **contact_options(arena),
    )
