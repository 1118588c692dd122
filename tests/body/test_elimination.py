"""The engine's order of elimination: a permutation with little fill, which changes nothing but rounding."""

from __future__ import annotations

from itertools import pairwise

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.body import build_spec, compile_spec, crossing_site
from annelid.body.constraint_rows import HELD
from annelid.body.formulations.rods import elimination, net
from annelid.body.formulations.rods.elimination import nested_dissection
from annelid.config import load_config
from annelid.errors import RunFileError
from annelid.morphology import Array
from annelid.simulation.worm import WormPlant

Graph = list[set[int]]


def graph_of(n: int, pairs: list[list[int]]) -> Graph:
    neighbours: Graph = [set() for _ in range(n)]
    for one, other in pairs:
        neighbours[one] |= {other} - {one}
        neighbours[other] |= {one} - {other}
    return neighbours


def fill(graph: Graph, order: list[int]) -> int:
    """Entries of the factor, by eliminating one vertex after the other from a dense adjacency."""
    coupled, total = np.eye(len(graph), dtype=bool), 0
    for vertex, around in enumerate(graph):
        coupled[vertex, [*around]] = True
    for vertex in order:
        around = np.flatnonzero(coupled[vertex])
        total += len(around)
        coupled[np.ix_(around, around)] = True
        coupled[vertex] = coupled[:, vertex] = False
    return total


def tube(n_planes: int, n_around: int = 6) -> tuple[Graph, Array]:
    """A grid rolled up into a tube, and each vertex's place along it."""
    number = np.arange(n_planes * n_around).reshape(n_planes, n_around)
    along = np.stack([number[:-1].ravel(), number[1:].ravel()], axis=1)
    around = np.stack([number.ravel(), np.roll(number, 1, axis=1).ravel()], axis=1)
    place = np.repeat(np.arange(n_planes, dtype=np.float64), n_around)
    return graph_of(number.size, np.concatenate([along, around]).tolist()), place


@settings(max_examples=40)
@given(n=st.integers(2, 60), largest=st.integers(1, 12), seed=st.integers(0, 2**32 - 1))
def test_every_vertex_of_any_graph_is_eliminated_once(n: int, largest: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    graph = graph_of(n, random.integers(0, n, (2 * n, 2)).tolist())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(elimination, "LARGEST_PART", largest)
        order = nested_dissection(graph, random.integers(0, 5, n).astype(np.float64))
    assert sorted(order) == list(range(n))


@settings(max_examples=40)
@given(n=st.integers(2, 40), seed=st.integers(0, 2**32 - 1))
def test_nothing_is_filled_in_a_tree(n: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    tree = graph_of(n, [[vertex, int(random.integers(vertex))] for vertex in range(1, n)])
    assert fill(tree, nested_dissection(tree, np.zeros(n))) == 2 * n - 1


def test_each_further_length_of_a_tube_adds_the_same_fill(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(elimination, "LARGEST_PART", 40)
    graph, place = tube(21)
    assert len({*place[nested_dissection(graph, place)[-6:]]}) == 1, "the last separator must be one ring"
    totals = [fill(graph, nested_dissection(graph, place)) for graph, place in map(tube, (40, 80, 160))]
    first, second = (later - earlier for earlier, later in pairwise(totals))
    assert second / (2 * first) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("pins", ["shared", "separate"])
def test_a_worm_moves_the_same_in_any_order(pins: str, monkeypatch: pytest.MonkeyPatch) -> None:
    changes = {"body.mesh.n_segments": 6, "body.formulation.pins": pins, "body.mesh.elements_per_side": 1}

    def moved() -> WormPlant:
        plant = WormPlant(load_config("riddle2023-rods", changes))
        plant.move(np.where(np.arange(plant.n_muscles) % 3, 0.0, 0.5), 8)
        return plant

    ours = moved()
    monkeypatch.setattr(net, "elimination_order", lambda bodies, *_: bodies)
    theirs = moved()
    assert not np.array_equal(ours.qpos, theirs.qpos)
    np.testing.assert_allclose(ours.coordinates, theirs.coordinates, atol=1e-7)
    with pytest.raises(RunFileError, match="orders the worm's bodies otherwise"):
        ours.set_state(theirs.get_state())
    assert np.ptp(ours.observe().ring_length_m) > 0.1, "it must have moved"
    # A model that is no plant's is where the plant is in the coordinates that a run records.
    model = compile_spec(build_spec(ours._config))
    # So have the run files of older versions.
    assert model.body(HELD).id == (3 if pins == "separate" else model.body("strand_0_twist_0").id - 1)
    data = mujoco.MjData(model)
    data.qpos[:] = ours.coordinates
    mujoco.mj_kinematics(model, data)
    sites = [model.site(crossing_site(i)).id for i in range(ours.geometry.n_crossings)]
    np.testing.assert_allclose(data.site_xpos[sites], ours.posture.crossing, atol=1e-12)
    np.testing.assert_array_equal(ours.anatomy.own(ours.coordinates), ours.qpos)


def test_a_long_worm_has_a_smaller_factor_than_in_the_engines_order(monkeypatch: pytest.MonkeyPatch) -> None:
    def entries() -> int:
        plant = WormPlant(load_config("riddle2023-rods", {"body.mesh.n_segments": 12}))
        plant.move(0.5 * (np.arange(plant.n_muscles) % 3 == 0), 3)
        return int(plant.data.solver_nnz[0])

    ours = entries()
    monkeypatch.setattr(net, "elimination_order", lambda bodies, *_: bodies)
    assert ours < 0.8 * entries()
