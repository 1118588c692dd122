"""What the agent is told: named entries with units and ranges, each scaled into [-1, 1] or [0, 1]."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import prod

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from annelid.environments.way import Place
from annelid.morphology import Array
from annelid.protocols import SIDES, Sensation
from annelid.simulation.worm import Worm

Observation = NDArray[np.float32]
STANDARD_GRAVITY_M_PER_S2 = 9.80665
"""What the worm's weight is computed with, whatever acts on it."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One kind of number in an observation.

    Attributes:
        name: For example ``"ring_strain"``.
        shape: Shape of these numbers.
        unit: Of the number before it is scaled.
        low: What the lower end of the scaled range stands for: ``-high`` or 0.
        high: What 1 stands for; numbers beyond are clipped.
        meaning: What it is, in words.
    """

    name: str
    shape: tuple[int, ...]
    unit: str
    low: float
    high: float
    meaning: str

    @property
    def size(self) -> int:
        """How many numbers these are."""
        return prod(self.shape)


class Layout:
    """How an observation is laid out.

    Attributes:
        entries: Its entries in order.
        size: How many numbers it has.
    """

    def __init__(self, entries: tuple[Entry, ...]) -> None:
        self.entries = entries
        self.size = sum(entry.size for entry in entries)
        self._high = np.concatenate([np.full(entry.size, entry.high) for entry in entries])
        self._least = np.concatenate([np.full(entry.size, entry.low / entry.high) for entry in entries])

    def space(self) -> Box[np.float32]:
        """Returns the space of observations, ``(size,)``."""
        return Box(self._least.astype(np.float32), np.ones(self.size, dtype=np.float32), (self.size,), np.float32)

    def packed(self, values: Mapping[str, Array]) -> Observation:
        """Scales and clips numbers in their units, by name, and lays them out.

        Returns:
            Shape ``(size,)``.
        """
        flat = np.concatenate([np.ravel(values[entry.name]) for entry in self.entries])
        return np.clip(flat / self._high, self._least, 1.0).astype(np.float32)

    def named(self, observations: ArrayLike) -> dict[str, Array]:
        """Takes observations apart: numbers in their units, by name.

        Args:
            observations: Shape ``(..., size)``; of one worm or of many.

        Returns:
            Each of shape ``(..., *entry.shape)``.
        """
        scaled: Array = np.asarray(observations, dtype=float)
        starts = np.cumsum([0, *(entry.size for entry in self.entries)])
        return {
            entry.name: entry.high * scaled[..., start : start + entry.size].reshape(*scaled.shape[:-1], *entry.shape)
            for entry, start in zip(self.entries, starts, strict=False)
        }


def layout_of(worm: Worm) -> Layout:
    """Returns how a worm's observations are laid out."""
    n, m, sensors = worm.n_segments, worm.n_muscles, worm.anatomy.rest_stretch_m.shape
    ring = "change of a ring muscle's length since the start, of that length"
    stretch = "change of a stretch sensor's length from that at rest, of that length"
    touch = "normal force of the ground on belly, left, back, right"
    heading = "unit vector from the last ring to the first, along the axes below"
    upright = "how far the middle ring's back and left side point upwards"
    velocity = "of the worm's middle over the last step, along the axes below"
    return Layout(
        (
            Entry("ring_strain", (m,), "1", -1.0, 1.0, ring),
            Entry("ring_rate", (m,), "1/s", -5.0, 5.0, "how fast the same has changed over the last step"),
            Entry("stretch_strain", sensors, "1", -2.0, 2.0, stretch),
            Entry("touch", (n, len(SIDES)), "weights", 0.0, 2.0, touch),
            Entry("heading", (3,), "1", -1.0, 1.0, heading),
            Entry("upright", (2,), "1", -1.0, 1.0, upright),
            Entry("velocity", (3,), "body lengths/s", -1.0, 1.0, velocity),
            Entry("activation", (m,), "1", 0.0, 1.0, "of the ring muscles at the end of the last step"),
        )
    )


class Senses:
    """Reads one worm's observations in their units, from one step of the environment to the next."""

    def __init__(self, worm: Worm, interval_s: float) -> None:
        """Takes the worm in its rest posture as what strains are counted from.

        Args:
            worm: The worm, after a reset.
            interval_s: Time of a step of the environment, s.
        """
        geometry = worm.geometry
        self._interval_s = interval_s
        self._length_m = geometry.length_m
        self._weight_N = worm.total_mass_kg * STANDARD_GRAVITY_M_PER_S2
        self._rest_m = worm.posture.ring_length.copy()
        self._middle_ring = geometry.rings[geometry.n_segments // 2]
        away = geometry.crossings_m[self._middle_ring]
        away = away - away.mean(axis=0)
        # Weights that make of the ring's corners its back and its left side.
        self._outwards = np.stack([away[:, 2], -away[:, 1]])

    def values(
        self, worm: Worm, felt: Sensation, before_m: Array, place: Place, moved_m: Array, activation: Array
    ) -> dict[str, Array]:
        """Returns the numbers of an observation.

        Args:
            worm: The worm.
            felt: What it feels, with the noise of its sensors.
            before_m: Lengths of its rings one step of the environment earlier, m, ``(n_muscles,)``.
            place: Where it is on its way.
            moved_m: What its middle has been displaced by in that step, m, ``(3,)``.
            activation: Of its muscles, ``(n_muscles,)``.
        """
        ring_m = felt.ring_length_m
        corners = worm.posture.crossing[self._middle_ring]
        sides = self._outwards @ (corners - corners.mean(axis=0))
        return {
            "ring_strain": ring_m / self._rest_m - 1.0,
            "ring_rate": (ring_m - before_m) / (self._rest_m * self._interval_s),
            "stretch_strain": felt.stretch_m / felt.rest_stretch_m - 1.0,
            "touch": felt.touch_N / self._weight_N,
            "heading": place.axes @ felt.heading,
            "upright": sides @ place.axes[2] / np.sqrt((sides * sides).sum(axis=1)),
            "velocity": place.axes @ moved_m / (self._length_m * self._interval_s),
            "activation": activation,
        }
