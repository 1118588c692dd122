"""The order in which the engine eliminates the bodies of a net of rods: nested dissection along the body.

Every Newton step factors a matrix whose graph is the mesh, and the engine eliminates bodies from the last to the first.
Cutting the tube across where the fewest bodies connect its sides, both halves likewise, and so on down to parts that
minimum degree orders well, makes fill and arithmetic proportional to length (George 1973, "Nested dissection of a
regular finite element mesh"). The order changes results by rounding only. A body at a contact changes all columns of
the factor from its own to the last that are coupled, which are fewer, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from heapq import heapify, heappop, heappush
from operator import itemgetter

import numpy as np

from annelid.body.actuation import crossing_site
from annelid.body.constraint_rows import HELD
from annelid.morphology import Array, MeshGeometry

LARGEST_PART = 400
"""Bodies that minimum degree orders without a further cut: about two segments; 300 to 500 do as well."""
LEAST_SHARE = 0.3
"""Of the bodies, on the smaller side of a cut."""
N_CUTS = 40
SAME_DIGITS = 9
"""Decimals of a place in lengths of the body: planes of one mesh are farther apart, rounding is less."""


def elimination_order(
    bodies: list[str], geometry: MeshGeometry, vertices: list[list[str]], hinges: list[list[str]]
) -> list[str]:
    """Orders the bodies of a net for the engine, which eliminates the last first.

    Args:
        bodies: Their names.
        geometry: The mesh.
        vertices: Names of the bodies of the vertices along each strand.
        hinges: Names of the twist hinges of the edges along each strand.
    """
    number = {name: i for i, name in enumerate(bodies)}
    place, coupled = np.zeros(len(bodies)), list[list[str]]()
    for x, names, edges in zip(geometry.vertices_m[..., 0], vertices, hinges, strict=True):
        place[[number[name] for name in names]] = x
        place[[number[name] for name in edges]] = (x[:-1] + x[1:]) / 2
        coupled += [names[v - 1 : v + 2] + edges[v - 1 : v + 1] for v in range(1, len(edges))]
    # Separate pins are tied to their strands, springs and muscles couple the crossings that they hold.
    for crossing, (plane, strands) in enumerate(
        zip(geometry.crossing_plane, geometry.crossing_strands.tolist(), strict=True)
    ):
        place[number[crossing_site(crossing)]] = geometry.plane_x_m[plane]
        tied = [vertices[strand][geometry.crossing_vertex[plane]] for strand in strands]
        coupled.append([crossing_site(crossing), *tied])
    coupled += [[crossing_site(i) for i in held] for held in (*geometry.springs.tolist(), *geometry.rings.tolist())]
    neighbours = [set[int]() for _ in bodies]
    for names in coupled:
        together = {number[name] for name in names}
        for one in together:
            neighbours[one] |= together - {one}
    # Rounded, so that all machines find the same order: a checkpoint is in it.
    order = nested_dissection(neighbours, np.round(place / geometry.length_m, SAME_DIGITS))
    # What every row includes is coupled to all: it goes last.
    return [HELD, *(bodies[i] for i in order[::-1] if bodies[i] != HELD)]


def nested_dissection(neighbours: Sequence[set[int]], place: Array) -> list[int]:
    """Orders the vertices of a graph that extends along one axis for elimination with little fill.

    Args:
        neighbours: The vertices that each vertex is coupled to.
        place: Of each vertex along the axis, ``(n,)``.

    Returns:
        Their numbers, that of the first to be eliminated first.
    """

    def ordered(part: set[int]) -> list[int]:
        halves = _halves(neighbours, place, part) if len(part) > LARGEST_PART else ()
        separator = part.difference(*halves)
        return [vertex for half in halves for vertex in ordered(half)] + _minimum_degree(neighbours, separator)

    return ordered({*range(len(place))})


def _halves(neighbours: Sequence[set[int]], place: Array, part: set[int]) -> tuple[set[int], ...]:
    """What the smallest separator at a cut across the axis leaves of the two sides; nothing where no cut divides."""
    found = list[tuple[int, int, set[int], set[int]]]()
    cuts = np.quantile(place[[*part]], np.linspace(LEAST_SHARE, 1.0 - LEAST_SHARE, N_CUTS), method="lower")
    for cut in np.unique(cuts).tolist():
        ahead = {vertex for vertex in part if place[vertex] <= cut}
        for side, other in ((ahead, part - ahead), (part - ahead, ahead)):
            kept = {vertex for vertex in side if neighbours[vertex].isdisjoint(other)}
            if kept and other:
                found.append((len(side) - len(kept), max(len(kept), len(other)), kept, other))
    return min(found, key=itemgetter(0, 1))[2:] if found else ()


def _minimum_degree(neighbours: Sequence[set[int]], part: set[int]) -> list[int]:
    """Orders some vertices of a graph by greedy minimum degree, the others staying."""
    coupled = {vertex: neighbours[vertex] & part for vertex in sorted(part)}
    queue = [(len(around), vertex) for vertex, around in coupled.items()]
    heapify(queue)
    order: list[int] = []
    while queue:
        degree, vertex = heappop(queue)
        if vertex not in coupled or degree != len(coupled[vertex]):
            continue
        around = coupled.pop(vertex)
        order.append(vertex)
        for other in around:
            coupled[other] = (coupled[other] | around) - {vertex, other}
            heappush(queue, (len(coupled[other]), other))
    return order
