from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import imageio.v3
import numpy as np
import pytest

from annelid.draw import plots
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


def test_figure7_of_a_3d_worm_shows_six_sensors(rods_run: Run, picture: Path) -> None:
    assert rods_run.data.sizes["sensor"] == 6
    assert figure7(rods_run, picture).stat().st_size > 10_000


def test_published_elongations_end_at_lines_that_are_named(rods_run: Run, picture: Path) -> None:
    from matplotlib.figure import Figure

    axes = Figure().subplots()
    plots._lengths(axes, rods_run, line_looks(3))
    first_helix = 100.0 * rods_run.data["stretch_length"].values[:, :, 0]
    expected = first_helix.min(axis=0) + np.array([4.20, 2.55, 4.02])
    levels = [line for line in axes.lines if np.size(line.get_xdata()) == 2 and line.get_linestyle() == "--"]
    assert sorted(float(np.asarray(line.get_ydata())[0]) for line in levels) == pytest.approx(sorted(expected))
    named = [text.get_text().removeprefix("paper: ") for text in axes.texts if text.get_text().startswith("paper")]
    assert sorted(",".join(named).replace(" ", "").split(",")) == ["1", "2", "3"]
    other = replace(rods_run, config=rods_run.config.model_copy(update={"published": None}))
    axes = Figure().subplots()
    plots._lengths(axes, other, line_looks(3))
    assert [text.get_text() for text in axes.texts] == ["at rest"]


def test_the_legend_names_every_segment_or_evenly_spaced_ones_of_many(subtests: pytest.Subtests) -> None:
    for n_segments in (1, 3, 4, 8, 60):
        with subtests.test(f"{n_segments!r:.60}"):
            from matplotlib.figure import Figure

            figure = Figure(layout="constrained")
            plots._name_segments(figure, line_looks(n_segments), "title")
            (legend,) = figure.legends
            named = [int(text.get_text().removeprefix("segment ")) for text in legend.get_texts()]
            assert (named[0], named[-1]) == (1, n_segments)
            assert named == list(range(1, n_segments + 1)) or len(named) == 16


def test_lines_differ_in_dashes_in_grey_and_for_colour_blind_readers(subtests: pytest.Subtests) -> None:
    for n_lines in (2, 3, 4):
        with subtests.test(f"{n_lines!r:.60}"):
            from matplotlib.colors import to_rgb

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
    empty = replace(planar_run, data=planar_run.data.isel(time=slice(0, 1)))
    with pytest.raises(RunFileError, match="too little to plot"):
        figure7(empty, picture)
    assert not picture.exists()


def test_segments_differ_in_greyscale_when_they_are_few(subtests: pytest.Subtests) -> None:
    for n_segments in (3, 4, 6, 12, 60):
        with subtests.test(f"{n_segments!r:.60}"):
            from matplotlib.colors import to_rgb

            grey = [np.dot(to_rgb(color), (0.299, 0.587, 0.114)) for color in segment_colors(n_segments)]
            assert len(grey) == n_segments
            assert np.all(np.diff(grey) > 0), "dark to light from front to rear"
