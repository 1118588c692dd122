"""The order in which the engine eliminates the vertices of a net of rods: nested dissection along the body.

Each step factors matrices whose graph is the mesh. The engine orders their unknowns by minimum degree, which suits a
short worm; along a long tube its fronts meet at random, and the factor of twelve segments takes five times the
arithmetic it needs. Cutting the tube across where the fewest vertices connect it, both halves likewise, and so
on down to parts that minimum degree does well, makes fill and arithmetic proportional to length (George 1973).

The order lives in the compiled model (``MjModel.efmC_perm``), from where the engine's constraint solver takes it too;
it changes results by rounding only, and is not part of a written MJCF.
"""

from __future__ import annotations

from heapq import heapify, heappop, heappush

import mujoco
import numpy as np

from annelid.morphology import Array, Indices

SHORT_TUBE = 850
"""Vertices below which the engine's own order does as well: 6 segments of three elements a side."""
LARGEST_PART = 200
"""Vertices that minimum degree orders without a further cut: about two segments; 150 to 250 do as well."""
LEAST_SHARE = 0.3
"""Of the vertices, on the smaller side of a cut."""
SAME_PLACE_M = 1e-6
"""Vertices that lie on one plane at rest do so up to rounding."""


def order_elimination(model: mujoco.MjModel) -> None:
    """Makes the engine factor a long net of rods by nested dissection, in place; other models are left as they are.

    A later ``mj_setConst`` restores the engine's own order.
    """
    slots = model.efmC_perm
    dofs: Indices = np.sort(slots[slots >= 0])
    if len(dofs) < SHORT_TUBE:
        return
    bodies = model.dof_bodyid[dofs]
    order = nested_dissection(_couplings(model, bodies), model.body_pos[bodies, 0])
    # The engine counts from the far end: what stands first is eliminated last.
    slots[: len(dofs)] = dofs[order[::-1]]


def _couplings(model: mujoco.MjModel, bodies: Indices) -> Indices:
    """Pairs of vertices that a rod's bending or a spatial tendon couples, both ways, shape ``(n_pairs, 2)``."""
    vertex_of = np.full(model.nbody, -1)
    vertex_of[bodies] = np.arange(len(bodies))
    pairs: list[tuple[int, int]] = []
    for start, count in zip(model.flex_vertadr, model.flex_vertnum, strict=True):
        strand = vertex_of[model.flex_vertbodyid[start : start + count]].tolist()
        for reach in (1, 2):
            pairs.extend(zip(strand, strand[reach:], strict=False))
    for start, count in zip(model.tendon_adr, model.tendon_num, strict=True):
        path = slice(start, start + count)
        sites = model.wrap_objid[path][model.wrap_type[path] == mujoco.mjtWrap.mjWRAP_SITE]
        held = vertex_of[model.site_bodyid[sites]].tolist()
        pairs.extend((first, second) for first in held for second in held)
    found = np.array(pairs)
    found = found[(found >= 0).all(axis=1) & (found[:, 0] != found[:, 1])]
    return np.unique(np.concatenate([found, found[:, ::-1]]), axis=0)


def nested_dissection(pairs: Indices, position: Array, largest_part: int = LARGEST_PART) -> Indices:
    """Orders the vertices of a graph that extends along one axis for elimination with little fill, ``(n_vertices,)``.

    Given are the coupled vertices, both ways, ``(n_pairs, 2)``, each one's place along the axis, and the size of a part
    that is not cut any further.
    """
    neighbours: list[set[int]] = [set() for _ in position]
    for one, other in pairs.tolist():
        neighbours[one].add(other)

    def ordered(part: Indices, own: Indices) -> list[int]:
        halves = _cut(part, own, position) if len(part) > largest_part else None
        if halves is None:
            return minimum_degree(neighbours, part.tolist())
        inner = [ordered(half, own[np.isin(own, half).all(axis=1)]) for half in halves]
        separator = np.setdiff1d(part, np.concatenate(halves))
        return [*inner[0], *inner[1], *minimum_degree(neighbours, separator.tolist())]

    return np.array(ordered(np.arange(len(position)), pairs), dtype=np.int64)


def _cut(part: Indices, pairs: Indices, position: Array) -> tuple[Indices, Indices] | None:
    """Cuts a part across the axis where the fewest vertices connect its sides, and of these the most evenly.

    Returns what a separator on one side of the cut leaves of the two sides, or None where no cut divides the part.
    """
    # A vertex separates at a cut between its own place and that of its farthest neighbour.
    foremost, rearmost = position.copy(), position.copy()
    np.minimum.at(foremost, pairs[:, 0], position[pairs[:, 1]])
    np.maximum.at(rearmost, pairs[:, 0], position[pairs[:, 1]])
    place, foremost, rearmost = position[part], foremost[part], rearmost[part]

    levels = np.sort(place)
    cuts = levels[np.flatnonzero(np.diff(levels) > SAME_PLACE_M) + 1] - SAME_PLACE_M / 2
    before, front, rear = (np.searchsorted(np.sort(value), cuts) for value in (place, foremost, rearmost))
    uneven = np.maximum(before, len(part) - before)
    sizes = np.stack([before - rear, front - before])
    sizes = np.where(uneven <= (1.0 - LEAST_SHARE) * len(part), sizes, len(part))
    if not (sizes < len(part)).any():
        return None
    side, index = min(np.ndindex(*sizes.shape), key=lambda at: (sizes[at], uneven[at[1]]))
    cut = cuts[index]
    ahead = place < cut
    separates = ahead & (rearmost >= cut) if side == 0 else ~ahead & (foremost < cut)
    return part[ahead & ~separates], part[~ahead & ~separates]


def minimum_degree(neighbours: list[set[int]], vertices: list[int]) -> list[int]:
    """Orders some vertices of a graph for elimination by greedy minimum degree, the others staying."""
    coupled = {vertex: set(neighbours[vertex]) for vertex in vertices}
    queue = [(len(around), vertex) for vertex, around in coupled.items()]
    heapify(queue)
    order: list[int] = []
    while queue:
        degree, vertex = heappop(queue)
        if vertex not in coupled or degree != len(coupled[vertex]):
            continue
        around = coupled.pop(vertex)
        order.append(vertex)
        for other in around & coupled.keys():
            coupled[other] |= around
            coupled[other] -= {vertex, other}
            heappush(queue, (len(coupled[other]), other))
    return order
