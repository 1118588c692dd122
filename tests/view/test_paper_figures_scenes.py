from __future__ import annotations

from pathlib import Path

import imageio.v3
import numpy as np
import pytest

from annelid.body.worm import WormBody
from annelid.draw.strands import POINTS_PER_SIDE
from annelid.errors import ConfigError, RunFileError
from annelid.morphology import MeshGeometry
from annelid.simulation.runfile import Run
from annelid_studies.riddle2023.figures.propagation import figure_8_propagation, measure_propagation
from annelid_studies.riddle2023.figures.renderings import (
    figure_4_model,
    recorded_posture,
    rhombus_outline,
)
from annelid_studies.riddle2023.figures.rhombi import actuated, rhombus_plane

LATE_S = 0.2


def mesh(run: Run) -> MeshGeometry:
    assert isinstance(run.config.body, WormBody)
    return run.config.body.geometry()


def check_files(png: Path) -> None:
    """Both files are there, and the picture has ink on white."""
    assert png.suffix == ".png"
    pixels = imageio.v3.imread(png)[..., :3]
    assert 0.02 < (pixels < 200).any(axis=-1).mean() < 0.6
    drawing = png.with_suffix(".svg").read_text(encoding="utf-8")
    assert drawing.count("<path") > 20


def test_strands_of_a_recorded_posture_pass_through_the_pins(rods_run: Run) -> None:
    posture = recorded_posture(rods_run, LATE_S)
    geometry = posture.geometry
    assert np.abs(posture.crossings_m - geometry.crossings_m).max() > 0.005, "it has moved"
    for crossing, strands in enumerate(geometry.crossing_strands):
        point = POINTS_PER_SIDE * (geometry.crossing_plane[crossing] + 1)
        for strand in strands:
            np.testing.assert_allclose(posture.strands_m[strand, point], posture.crossings_m[crossing], atol=1e-6)


def test_an_outline_visits_the_rhombus_corners_and_closes(rods_run: Run) -> None:
    posture = recorded_posture(rods_run, LATE_S)
    for rhombus in (0, 17, len(posture.geometry.rhombi) - 1):
        line = rhombus_outline(posture, rhombus)
        assert len(line) == 4 * POINTS_PER_SIDE + 1
        np.testing.assert_array_equal(line[0], line[-1])
        np.testing.assert_array_equal(line[:-1:POINTS_PER_SIDE], posture.crossings_m[posture.geometry.rhombi[rhombus]])
        steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
        assert steps.max() < 1.5 * steps.min(), "it follows the strands and does not jump"


def test_figures_4_and_8_are_drawn(rods_run: Run, tmp_path: Path) -> None:
    captions = [
        figure_4_model(rods_run.config, tmp_path / "figure_4"),
        figure_8_propagation(rods_run, tmp_path / "figure_8", LATE_S),
    ]
    for name, caption in zip(("figure_4", "figure_8"), captions, strict=True):
        check_files(tmp_path / f"{name}.png")
        assert len(caption) > 100


def test_near_and_far_rhombi_are_unactuated_and_off_the_contracted_ring(rods_run: Run) -> None:
    measured = measure_propagation(rods_run, LATE_S)
    geometry = mesh(rods_run)
    assert measured.segment == 0, "the paper's order starts with segment 1"
    ring = set(geometry.rings[0].tolist())
    for one in (measured.near, measured.far):
        assert not actuated(geometry)[one.rhombus]
        assert not ring & set(geometry.rhombi[one.rhombus].tolist())
    assert abs(measured.near.distance_m) == pytest.approx(2 * (geometry.plane_x_m[1] - geometry.plane_x_m[0]))
    reach = np.abs(geometry.plane_x_m[rhombus_plane(geometry)] - geometry.plane_x_m[geometry.ring_planes[0]])
    assert abs(measured.far.distance_m) == pytest.approx(reach.max())
    near, far = (abs(one.length_m[1] / one.length_m[0] - 1) for one in (measured.near, measured.far))
    assert near > 0.02
    assert far < 0.5 * near
    assert "length 7.5 →" in str(measured.near)


def test_planar_worms_and_times_outside_are_refused(planar_run: Run, rods_run: Run, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="this needs the 3D worm"):
        figure_4_model(planar_run.config, tmp_path / "figure")
    with pytest.raises(ConfigError, match="this needs the 3D worm"):
        figure_8_propagation(planar_run, tmp_path / "figure")
    with pytest.raises(RunFileError, match=r"no picture at 1\.5 s"):
        figure_8_propagation(rods_run, tmp_path / "figure")
    assert not list(tmp_path.iterdir())
