from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import imageio.v3
import numpy as np
import pytest
from matplotlib.colors import to_rgb

from annelid.analysis.paper import published
from annelid.draw.canvas import line_looks, segment_colors
from annelid.draw.plots import figure7
from annelid.errors import RunFileError
from annelid.simulation.runfile import Run


def test_figure7_is_a_picture_with_curves_on_white(planar_run: Run, picture: Path) -> None:
    assert figure7(planar_run, picture) == picture
    pixels = imageio.v3.imread(picture)[:, :, :3]
    assert 900 < pixels.shape[1] < 1300
    assert 600 < pixels.shape[0] < 1300
    white = np.mean(np.all(pixels == 255, axis=2))
    assert 0.5 < white < 0.98
    for color in segment_colors(3):
        wanted = [int(color[i : i + 2], 16) for i in (1, 3, 5)]
        assert np.any(np.all(pixels == wanted, axis=2)), f"nothing drawn in {color}"


def test_neurons_of_any_name_are_drawn(planar_run: Run, picture: Path) -> None:
    n = planar_run.data.sizes["neuron"]
    own = planar_run.with_data(planar_run.data.assign_coords(neuron=[f"cell {i}" for i in range(n)]))
    figure7(own, picture)
    pixels = imageio.v3.imread(picture)[:400, :, :3].astype(int)
    for color in segment_colors(min(n, 16)):
        assert np.abs(pixels - 255 * np.array(to_rgb(color))).max(axis=2).min() < 2, f"no neuron drawn in {color}"


def test_published_levels_are_drawn_under_the_papers_controller_only(rods_run: Run, picture: Path) -> None:
    own = rods_run.with_data(rods_run.data.assign_attrs(controller="mine"))
    pictures = [imageio.v3.imread(figure7(run, picture))[-400:] for run in (rods_run, own)]
    assert pictures[0].shape != pictures[1].shape or (pictures[0] != pictures[1]).any()
    assert published(rods_run.config)


def test_lines_differ_in_dashes_in_grey_and_for_colour_blind_readers() -> None:
    for n_lines in (2, 3, 4):
        looks = line_looks(n_lines)
        assert len({str(look["linestyle"]) for look in looks}) == n_lines
        linear = np.array([to_rgb(look["color"]) for look in looks]) ** 2.2
        # What red-blind and green-blind eyes are left with (Vienot et al., 1999).
        for kept in ([[0.1121, 0.8853, -0.0005]] * 2, [[0.2920, 0.7054, -0.0003]] * 2):
            seen = np.clip(linear @ np.array([*kept, [0.0, 0.0, 1.0]]).T, 0.0, 1.0) ** (1 / 2.2)
            apart = np.abs(seen[:, None] - seen).max(axis=2)[~np.eye(n_lines, dtype=bool)]
            assert apart.min() > 0.15


def test_figure7_leaves_pyplot_and_the_users_settings_alone(planar_run: Run, picture: Path) -> None:
    program = (
        "import sys, matplotlib\n"
        # Asking for the backend is what makes matplotlib choose one, through pyplot.
        "settings = lambda: {k: matplotlib.rcParams[k] for k in matplotlib.rcParams if k != 'backend'}\n"
        "before = settings()\n"
        "from annelid.simulation.runfile import open_run\n"
        "from annelid.draw.plots import figure7\n"
        f"figure7(open_run({str(planar_run.path)!r}), {str(picture)!r})\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
        "assert settings() == before\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr


def test_a_run_without_samples_is_refused_in_a_sentence(planar_run: Run, picture: Path) -> None:
    empty = planar_run.with_data(planar_run.data.isel(time=slice(0, 1)))
    with pytest.raises(RunFileError, match="too little to plot"):
        figure7(empty, picture)
    assert not picture.exists()
