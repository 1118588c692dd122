"""The engine's factor order: a permutation with little fill that changes nothing but rounding."""

from __future__ import annotations

import warnings
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.body import assemble, build_spec, compile_spec
from annelid.body.elimination import minimum_degree, nested_dissection, order_elimination
from annelid.config import load_config
from annelid.morphology import Array, Indices
from annelid.simulation.worm import WormPlant

SHORT = {"body.mesh.elements_per_side": 1}
LONG = {
    "body.mesh.n_segments": 12,
    "body.mesh.elements_per_side": 3,
    "body.formulation.solver_tolerance": 1e-12,
}


def fill(pairs: Indices, order: Indices) -> int:
    """Couplings left in the factor, by eliminating one vertex after the other from a dense adjacency."""
    n = len(order)
    coupled = np.eye(n, dtype=bool)
    coupled[pairs[:, 0], pairs[:, 1]] = True
    total = 0
    for vertex in order:
        around = np.flatnonzero(coupled[vertex])
        total += len(around)
        coupled[np.ix_(around, around)] = True
        coupled[vertex] = coupled[:, vertex] = False
    return total


def both_ways(edges: list[tuple[int, int]]) -> Indices:
    pairs = np.array(edges)
    return np.concatenate([pairs, pairs[:, ::-1]])


def tube(n_planes: int, n_around: int) -> tuple[Indices, Array]:
    """A grid rolled up into a tube, and each vertex's place along it."""
    number = np.arange(n_planes * n_around).reshape(n_planes, n_around)
    along = np.stack([number[:-1].ravel(), number[1:].ravel()], axis=1)
    around = np.stack([number.ravel(), np.roll(number, 1, axis=1).ravel()], axis=1)
    edges = np.concatenate([along, around]).tolist()
    return both_ways(edges), np.array(np.repeat(np.arange(n_planes), n_around), dtype=np.float64)


@settings(max_examples=40)
@given(st.integers(2, 60), st.integers(1, 12), st.integers(0, 2**32 - 1))
def test_every_vertex_is_eliminated_once_on_any_graph(n_vertices: int, largest_part: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    pairs = random.integers(0, n_vertices, (2 * n_vertices, 2))
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    place: Array = np.asarray(random.integers(0, 5, n_vertices)).astype(np.float64)
    order = nested_dissection(np.concatenate([pairs, pairs[:, ::-1]]), place, largest_part)
    assert sorted(order.tolist()) == list(range(n_vertices))


@settings(max_examples=40)
@given(st.integers(2, 40), st.integers(0, 2**32 - 1))
def test_minimum_degree_fills_nothing_in_a_tree(n_vertices: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    pairs = both_ways([(vertex, int(random.integers(vertex))) for vertex in range(1, n_vertices)])
    neighbours = [set(pairs[pairs[:, 0] == vertex, 1].tolist()) for vertex in range(n_vertices)]
    order = minimum_degree(neighbours, list(range(n_vertices)))
    assert fill(pairs, np.array(order)) == 2 * n_vertices - 1


def test_the_last_separator_of_a_tube_is_one_ring_near_its_middle() -> None:
    pairs, place = tube(21, 6)
    last = place[nested_dissection(pairs, place, 30)[-6:]]
    assert len(set(last)) == 1
    assert 0.3 * 20 <= last[0] <= 0.7 * 20


def test_each_further_length_of_a_tube_adds_the_same_fill() -> None:
    totals = [fill(pairs, nested_dissection(pairs, place, 40)) for pairs, place in (tube(n, 6) for n in (40, 80, 160))]
    first, second = (later - earlier for earlier, later in pairwise(totals))
    assert abs(second / (2 * first) - 1) < 0.1


def moved() -> WormPlant:
    plant = WormPlant(load_config("riddle2023-rods", LONG))
    plant.move(np.where(np.arange(plant.n_muscles) % 3, 0.0, 0.5), 8)
    return plant


def test_a_long_worm_moves_the_same_with_a_smaller_factor(monkeypatch: pytest.MonkeyPatch) -> None:
    ours = moved()
    monkeypatch.setattr(assemble, "order_elimination", lambda model: None)
    theirs = moved()
    assert sorted(ours.model.efmC_perm) == sorted(theirs.model.efmC_perm)
    assert np.ptp(ours.observe().ring_length_m) > 0.1, "it must have moved"
    np.testing.assert_allclose(ours.qpos, theirs.qpos, atol=1e-9)
    assert ours.data.solver_nnz[0] < 0.9 * theirs.data.solver_nnz[0]


def test_short_worms_and_chains_keep_the_engines_order() -> None:
    for preset in ("riddle2023-rods", "riddle2023"):
        model = build_spec(load_config(preset)).compile()
        before = model.efmC_perm.copy()
        order_elimination(model)
        assert np.array_equal(model.efmC_perm, before)


def test_a_worm_beyond_the_engines_limit_is_warned_of(monkeypatch: pytest.MonkeyPatch) -> None:
    spec = build_spec(load_config("riddle2023-rods", SHORT))
    moving = sum(len(body.joints) > 0 for body in spec.worldbody.bodies)
    monkeypatch.setattr(assemble, "MOST_ORDERED_BODIES", moving)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        compile_spec(spec)
    monkeypatch.setattr(assemble, "MOST_ORDERED_BODIES", moving - 1)
    with pytest.warns(UserWarning, match=f"{moving} moving bodies"):
        compile_spec(spec)
