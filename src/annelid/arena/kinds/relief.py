"""Floors whose relief begins in front of the worm: a flight of steps, and rough ground."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from annelid.arena.kinds.floor import Ground
from annelid.arena.surface import Implicit, Level, Shape, Surface, grid_faces
from annelid.config.sections import NonNegative, Positive, Seed
from annelid.protocols import Array

if TYPE_CHECKING:
    import mujoco

N_WAVES = 32
"""Waves that rough ground is the sum of."""
AHEAD_M, BEHIND_M, HALF_WIDTH_M = 6.0, 1.5, 2.0
"""How much is drawn of what goes on for ever, from the worm's front."""
GRAIN_M, ROUNDED_GRAIN = 0.03, 6
"""Of what is drawn: length of a triangle, and edges of a rounding."""
FIELD_GRAIN_M, BASE_M = 0.02, 0.1
"""Of what is touched in plain MuJoCo: grain of a height field, and thickness below the lowest point."""


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
        return Stairs(self.start_m, self.step_length_m, self.step_height_m, self.rounding_m, -self.floor_gap_m)

    @property
    def _n_shown(self) -> int:
        return max(int((AHEAD_M - self.start_m) / self.step_length_m), 1)

    def shape(self, length_m: float) -> Shape:
        """Returns the steps to be drawn."""
        turn = np.linspace(0.0, np.pi / 2, ROUNDED_GRAIN)
        r, h, start, length, n_steps = (
            self.rounding_m,
            self.step_height_m,
            self.start_m,
            self.step_length_m,
            self._n_shown,
        )
        inner = np.stack([-r + r * np.sin(turn), r - r * np.cos(turn)], axis=-1)
        edge = np.stack([r - r * np.cos(turn), h - r + r * np.sin(turn)], axis=-1)
        risers = [np.concatenate([inner, edge]) + np.array([start + k * length, k * h]) for k in range(n_steps)]
        end = [[AHEAD_M, n_steps * h]] if n_steps * length + start < AHEAD_M else []
        line = np.concatenate([[[-BEHIND_M, 0.0]], *risers, np.reshape(end, (-1, 2))])
        x, y = np.meshgrid(-line[:, 0], np.linspace(-HALF_WIDTH_M, HALF_WIDTH_M, 9), indexing="ij")
        z = np.broadcast_to(line[:, 1:] - self.floor_gap_m, x.shape)
        return Shape(np.stack([x, y, z], axis=-1).reshape(-1, 3), grid_faces(*x.shape)[:, ::-1])

    def add_panels(self, spec: mujoco.MjSpec, length_m: float) -> None:
        """Adds a block a step."""
        from annelid.arena.geoms import add_box

        bottom = -self.floor_gap_m - BASE_M
        edges = [BEHIND_M, *(-self.start_m - k * self.step_length_m for k in range(self._n_shown))]
        for step, edge in enumerate(edges):
            top = -self.floor_gap_m + step * self.step_height_m
            place = np.array([(edge - AHEAD_M) / 2, 0.0, (top + bottom) / 2])
            add_box(spec, self, place, [(edge + AHEAD_M) / 2, HALF_WIDTH_M, (top - bottom) / 2], np.eye(3))


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

    def ground(self) -> Hills:
        """Returns the ground that `relief_seed` draws; its correlation is Gaussian in the distance."""
        generator = np.random.default_rng(self.relief_seed)
        waves = generator.normal(scale=sqrt(2.0) / self.correlation_m, size=(N_WAVES, 2))
        phases = generator.uniform(0.0, 2.0 * np.pi, size=N_WAVES)
        amplitude = self.roughness_m * sqrt(2.0 / N_WAVES)
        return Hills(self.start_m, self.correlation_m, amplitude, waves, phases, -self.floor_gap_m)

    def shape(self, length_m: float) -> Shape:
        """Returns the ground to be drawn."""
        ahead = np.arange(-BEHIND_M, AHEAD_M, GRAIN_M)
        x, y = np.meshgrid(-ahead, np.arange(-HALF_WIDTH_M, HALF_WIDTH_M, GRAIN_M), indexing="ij")
        height, _ = self.ground().height(np.stack([x, y], axis=-1))
        return Shape(np.stack([x, y, height - self.floor_gap_m], axis=-1).reshape(-1, 3), grid_faces(*x.shape)[:, ::-1])

    def add_panels(self, spec: mujoco.MjSpec, length_m: float) -> None:
        """Adds a height field."""
        import mujoco

        from annelid.arena.friction import contact_options
        from annelid.arena.geoms import HIDDEN_GROUP

        half_length, middle = (AHEAD_M + BEHIND_M) / 2, (BEHIND_M - AHEAD_M) / 2
        columns, rows = (int(2 * half / FIELD_GRAIN_M) + 1 for half in (half_length, HALF_WIDTH_M))
        x = middle + np.linspace(-half_length, half_length, columns)
        y = np.linspace(-HALF_WIDTH_M, HALF_WIDTH_M, rows)
        height, _ = self.ground().height(np.stack(np.meshgrid(x, y), axis=-1))
        lowest, span = float(height.min()), float(np.ptp(height))
        spec.add_hfield(
            name="relief",
            nrow=rows,
            ncol=columns,
            size=[half_length, HALF_WIDTH_M, span, BASE_M],
            userdata=((height - lowest) / span).ravel(),
        )
        spec.worldbody.add_geom(
            name="relief",
            type=mujoco.mjtGeom.mjGEOM_HFIELD,
            hfieldname="relief",
            pos=[middle, 0.0, lowest - self.floor_gap_m],
            group=HIDDEN_GROUP,
            **contact_options(self),
        )


@dataclass(frozen=True)
class Stairs(Surface):
    """A flight of steps with rounded edges and inner corners, whose distance is exact within half a step's length."""

    start_m: float  # where the first step rises, ahead of the worm's front
    length_m: float  # of a step
    height_m: float  # of a step
    rounding_m: float  # at most half of either
    level_m: float  # height z of the level ground before it

    def nearest(self, points_m: Array, *, first_order: bool = False) -> tuple[Array, Array]:
        """Returns distance and normal of the nearest tread, riser or rounding, as `Surface.nearest`."""
        ahead_m, up_m = -points_m[..., 0], points_m[..., 2] - self.level_m
        # By symmetry every point sees one riser only: the nearest, at the origin.
        step = np.maximum(np.round((ahead_m - self.start_m) / self.length_m), 0.0)
        x, z = ahead_m - self.start_m - step * self.length_m, up_m - step * self.height_m
        r, h = self.rounding_m, self.height_m
        corner, edge = np.hypot(x + r, z - r), np.hypot(x - r, z - h + r)
        # Where a part is the nearest, the signed distance from it, and the two shares of its normal, ahead and up.
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
        return best, np.stack([-ahead, np.zeros(ahead.shape), up], axis=-1)


def _shares(x: Array, z: Array, length: Array) -> tuple[Array, Array]:
    length = np.where(length > 0.0, length, 1.0)
    return x / length, z / length


@dataclass(frozen=True)
class Hills(Implicit):
    """Rough ground: a sum of plane waves, which swells from level ground over one correlation length."""

    start_m: float  # where it begins, ahead of the worm's front
    swell_m: float  # length over which it swells to its full height
    amplitude_m: float  # of each wave
    wave_per_m: Array  # wave vectors, 1/m, (n_waves, 2)
    phase_rad: Array  # (n_waves,)
    level_m: float  # height z of the level ground before it

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

    def level(self, points_m: Array) -> Level:
        """Returns heights above the ground straight below, m."""
        height, slope = self.height(points_m[:, :2])
        gradient = np.concatenate([-slope, np.ones((len(slope), 1))], axis=-1)
        return Level(points_m[:, 2] - self.level_m - height, gradient, np.zeros(len(height), dtype=bool))
