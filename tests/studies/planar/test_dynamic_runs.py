"""The dynamic planar worms under the paper's network: order, run file, and pictures."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from annelid import Run, load_config, simulate, summary
from annelid.draw.planar_scene import PlanarScene
from annelid_studies.planar import bent_rhombi, rhombi

PRESETS = ("daltorio2013", "boxerbaum2012")


@pytest.fixture(scope="module", params=PRESETS)
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Run:
    config = load_config(request.param, {"body.n_segments": 3, "duration_s": 4.0, "clock.physics_timestep_s": 0.002})
    return simulate(config, tmp_path_factory.mktemp(request.param) / "run", progress=False)


def test_segments_contract_in_order_at_the_network_s_pace(run: Run) -> None:
    numbers = summary(run)
    assert numbers.order[:4] == [1, 2, 3, 1]
    # After the start, in which segment 1 is still at rest and its sensor held off, each takes 875 ms.
    assert np.diff(numbers.onsets_s)[2:] == pytest.approx(0.875, abs=0.01)


def test_only_the_worm_in_the_pipe_travels_and_slips(run: Run) -> None:
    in_pipe = run.config.body.kind == "daltorio2013"
    travel = summary(run).travel_m
    assert travel is not None
    assert (travel > 0.02) if in_pipe else (abs(travel) < 1e-5)
    assert ("slip_loss" in run.data) == ("contact_force" in run.data) == in_pipe


def test_pictures_show_the_contracted_segment_red_and_in_its_place(run: Run) -> None:
    activation = run.data["activation"].values
    middles = []
    with PlanarScene(run, 640, 192) as scene:
        for segment in range(3):
            others = np.delete(activation, segment, axis=1).max(axis=1)
            pixels = scene.picture(int(np.argmax(activation[:, segment] - others))).astype(int)
            red = (pixels[..., 0] > 180) & (pixels[..., 1] < 90) & (pixels[..., 2] < 90)
            assert red.sum() > 1000
            middles.append(np.flatnonzero(red.any(axis=0)).mean())
    assert np.all(np.diff(middles) > 80)


@pytest.mark.parametrize("run", ["daltorio2013"], indirect=True)
def test_an_outline_of_rhombi_closes_to_rhombi(run: Run) -> None:
    data = run.data.isel(time=-1)
    found = bent_rhombi(data["outline"].values, 3)
    expected = rhombi(data["stretch_length"].values[:, 0], data["ring_length"].values)
    assert found - found[0, 0] == pytest.approx(expected - expected[0, 0], abs=1e-12)
    for left, right in pairwise(found):
        assert left[2] == pytest.approx(right[0])


def test_rhombi_touch_tip_to_tip_and_keep_their_sides() -> None:
    side = 0.073
    heights = np.array([0.065, 0.11, 0.09])
    lengths = np.sqrt((2 * side) ** 2 - heights**2)
    corners = rhombi(lengths, heights)
    np.testing.assert_allclose(corners[:-1, 2], corners[1:, 0], atol=1e-15)
    sides = np.linalg.norm(np.diff(np.concatenate([corners, corners[:, :1]], axis=1), axis=1), axis=2)
    np.testing.assert_allclose(sides, side)
    assert corners[0, 0, 0] == pytest.approx(-corners[-1, 2, 0]), "the middle of the worm is at the origin"
