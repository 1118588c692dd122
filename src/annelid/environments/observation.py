"""What an agent observes of a worm, and where the worm is on its route."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import prod
from typing import NamedTuple

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from annelid.arena.centre_line import AHEAD, LEFT, UP
from annelid.config import ArenaKind
from annelid.markdown import table
from annelid.morphology import Array
from annelid.protocols import SIDES
from annelid.simulation.worm import WormPlant

Observation = NDArray[np.float32]


class Place(NamedTuple):
    """Where a worm is on its route."""

    along_m: float  # how far its middle has come, from a point of the arena
    axes: Array  # unit vectors forwards, to the left and upwards there, as rows, (3, 3)


class Route:
    """The path that a worm is to go: straight ahead on open ground, or along a pipe's centre line."""

    def __init__(self, arena: ArenaKind) -> None:
        """Takes the arena."""
        self._line = arena.centre_line()
        self._axes = np.stack([AHEAD, LEFT, UP])

    def place(self, ring_centre_m: Array) -> Place:
        """Finds a worm's place from the centres of its rings, m, ``(n_segments, 3)``."""
        middle = ring_centre_m.mean(axis=0)
        if self._line is None:
            return Place(float(middle @ self._axes[0]), self._axes)
        along = float(self._line.nearest(ring_centre_m).arc_m.mean())
        tangent = self._line.nearest(middle[np.newaxis]).tangent[0]
        left = np.cross(UP, tangent)
        left /= np.sqrt(left @ left)
        return Place(along, np.stack([tangent, left, np.cross(tangent, left)]))


@dataclass(frozen=True, slots=True)
class Entry:
    """One kind of number in an observation.

    Attributes:
        low: What the lower end of the scaled range stands for: ``-high`` or 0.
        high: What 1 stands for; numbers beyond are clipped.
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
    """How an observation is laid out: named entries with units and ranges, each scaled into [-1, 1] or [0, 1].

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
        """Scales, clips and lays out numbers.

        Args:
            values: Numbers in their units, by name.

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
        parts = np.split(scaled, np.cumsum([entry.size for entry in self.entries])[:-1], axis=-1)
        return {
            entry.name: entry.high * part.reshape(*scaled.shape[:-1], *entry.shape)
            for entry, part in zip(self.entries, parts, strict=True)
        }

    def table(self) -> str:
        """Returns the entries as a table in Markdown."""
        rows, first = [], 0
        for entry in self.entries:
            shape, span = " x ".join(map(str, entry.shape)), f"{entry.low:g} .. {entry.high:g}"
            numbers = f"{first} .. {first + entry.size - 1}"
            rows.append((numbers, f"`{entry.name}`", shape, entry.unit, span, entry.meaning))
            first += entry.size
        return table(("numbers", "entry", "shape", "unit", "scaled from", "meaning"), rows)


def layout_of(worm: WormPlant) -> Layout:
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
