"""Paths between neurons drawn as circles: straight, bent, round the ring and back to where they began."""

from __future__ import annotations

import numpy as np

from annelid.protocols import Array

RADIUS = 0.27
"""Radius of a neuron, in units of the distance between neighbours."""


def bow(start: Array, end: Array, bend: float) -> Array:
    """A parabola between two points whose middle is off the straight line by ``bend / 2`` of its length."""
    share = np.linspace(0.0, 1.0, 121)[:, np.newaxis]
    across = np.array([-(end - start)[1], (end - start)[0]])
    return (1 - share) * start + share * end + 2.0 * share * (1 - share) * bend * across


def between_rims(path: Array, start: Array, end: Array) -> Array:
    """The part of a path outside the neurons at its two ends."""
    outside = (np.linalg.norm(path - start, axis=1) >= RADIUS) & (np.linalg.norm(path - end, axis=1) >= RADIUS)
    return path[outside]


def self_loop(place: Array, outwards: float, number: int) -> Array:
    """Of a circle beside the neuron, the arc outside it."""
    radius = 0.2 + 0.08 * (number - 1)
    turn = outwards + np.linspace(-np.pi, np.pi, 121)
    center = place + (RADIUS + 0.6 * radius) * np.array([np.cos(outwards), np.sin(outwards)])
    loop = center + radius * np.column_stack([np.cos(turn), np.sin(turn)])
    return loop[np.linalg.norm(loop - place, axis=1) >= RADIUS]


def return_path(start: Array, end: Array, bottom: float, lane: int) -> Array:
    """A path with rounded corners that passes below all neurons, one lane further out for each before it."""
    aside, below = 0.62 + 0.22 * lane, bottom - 1.1 - 0.22 * lane
    corners = np.array(
        [
            (start[0] + RADIUS, start[1]),
            (start[0] + aside, start[1]),
            (start[0] + aside, below),
            (end[0] - aside, below),
            (end[0] - aside, end[1]),
            (end[0] - RADIUS, end[1]),
        ]
    )
    return _rounded(corners, 0.18)


def _rounded(corners: Array, radius: float) -> Array:
    """Replaces the corners of a path by parabolas that begin and end ``radius`` away from them."""
    share = np.linspace(0.0, 1.0, 9)[:, np.newaxis]
    pieces = [corners[:1]]
    for before, corner, after in zip(corners[:-2], corners[1:-1], corners[2:], strict=True):
        enter, leave = (corner + radius * (p - corner) / np.hypot(*(p - corner)) for p in (before, after))
        pieces.append((1 - share) ** 2 * enter + 2 * share * (1 - share) * corner + share**2 * leave)
    return np.concatenate([*pieces, corners[-1:]])


def with_resistor(path: Array) -> Array:
    """Turns the middle of a path into a zigzag."""
    along = arc_length(path)
    teeth = 0.5 * along[-1] + 0.3 * np.linspace(-0.5, 0.5, 13) * min(1.0, 2.0 * along[-1])
    direction = np.gradient(points_at(path, teeth), axis=0)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    height = 0.08 * np.array([0, *([1, 0, -1, 0] * 3)])[:, np.newaxis]
    zigzag = points_at(path, teeth) + height * np.column_stack([-direction[:, 1], direction[:, 0]])
    return np.concatenate([path[along < teeth[0]], zigzag[[0, *range(1, 12, 2), 12]], path[along > teeth[-1]]])


def arc_length(path: Array) -> Array:
    """Distance of every point from the beginning, along the path."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])


def points_at(path: Array, along: Array) -> Array:
    """Points at given distances along a path."""
    distance = arc_length(path)
    return np.column_stack([np.interp(along, distance, path[:, axis]) for axis in (0, 1)])


def angle_of(vector: Array) -> float:
    """Direction of a vector, rad."""
    return float(np.arctan2(vector[1], vector[0]))


def angle_between(one: float, other: float) -> float:
    """Angle from one direction to another the shorter way round, rad, 0 .. π."""
    return abs((one - other + np.pi) % (2.0 * np.pi) - np.pi)
