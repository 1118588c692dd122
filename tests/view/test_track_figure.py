from __future__ import annotations

from pathlib import Path

import imageio.v3
import numpy as np
import pytest

from annelid.config import load_config
from annelid.draw.figures.track import FRONT, track_figure
from annelid.errors import RunFileError
from annelid.simulation.loop import simulate
from annelid.simulation.runfile import Run


def drawn(pixels: np.ndarray, color: str) -> bool:
    wanted = [int(color[i : i + 2], 16) for i in (1, 3, 5)]
    return bool(np.any(np.abs(pixels.astype(int) - wanted).max(axis=2) < 12))


def test_the_track_has_the_worm_its_front_and_its_waypoints(tmp_path: Path, picture: Path) -> None:
    course = {"body.rings.layout": "halves", "turning": {"kind": "course", "waypoints": [[-1.0, -0.3]]}}
    config = load_config("riddle2023-rods", {**course, "duration_s": 0.2, "body.mesh.planes_between_rings": 4})
    run = simulate(config, tmp_path / "run", progress=False)
    assert track_figure(run, picture) == picture
    pixels = imageio.v3.imread(picture)[:, :, :3]
    assert drawn(pixels, FRONT)
    plain = simulate(load_config("riddle2023-rods", {"duration_s": 0.2}), tmp_path / "plain", progress=False)
    without = imageio.v3.imread(track_figure(plain, tmp_path / "plain.png"))[:, :, :3]
    assert pixels.shape != without.shape


def test_it_refuses_what_has_no_track(rods_run: Run, planar_run: Run, picture: Path) -> None:
    with pytest.raises(RunFileError, match="only the 3D worm"):
        track_figure(planar_run, picture)
    short = rods_run.with_data(rods_run.data.isel(frame=slice(1)))
    with pytest.raises(RunFileError, match="fewer than two recorded postures"):
        track_figure(short, picture)
    assert not picture.exists()
