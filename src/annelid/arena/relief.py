"""Ground that is not level: a flight of steps seen from the side, and rough ground as a random height."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Self

import numpy as np

from annelid.config import Rough
from annelid.protocols import Array

N_WAVES = 32
"""Waves that rough ground is the sum of."""


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
