from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from annelid.analysis.comparison import compare
from annelid.draw.canvas import segment_colors
from annelid.draw.figures.comparison import lengths_figure, travel_figure
from annelid.draw.summary_table import comparison_table, fields_table
from annelid.errors import RunFileError
from annelid.simulation.runfile import Run


def test_the_table_shows_numbers_differences_and_dashes(planar_run: Run, rods_run: Run) -> None:
    comparison = compare([planar_run, rods_run, planar_run, rods_run])
    text = comparison_table(comparison, everything=True)
    rows = [line for line in text.splitlines() if line.startswith("simulated time (s)")]
    assert rows[0].split()[3:] == ["3", "0.200", "3", "-93", "%", "+0.0", "%"]
    assert rows[1].split()[3:] == ["3", "0.200", "-93", "%"]
    (travel,) = {line.split()[2] for line in text.splitlines() if line.startswith("travel (mm)")}
    assert travel == "-"
    assert "largest pin gap" not in text, "no run has one"
    assert "elongation 3 (cm)" in text
    assert "elongation, mean (cm)" in comparison_table(comparison)
    assert max(map(len, text.splitlines())) <= 80


def test_the_fields_of_other_kinds_are_left_to_json(planar_run: Run, rods_run: Run) -> None:
    text = fields_table(compare([planar_run, rods_run]))
    assert '"riddle2022"' in text
    assert "body.mesh" not in text
    assert "sensor.tolerance_m" in text
    assert "--json lists all" in text


def test_every_run_gets_its_colour(planar_run: Run, rods_run: Run, tmp_path: Path) -> None:
    for draw in (lengths_figure, travel_figure):
        with Image.open(draw([planar_run, rods_run], ("planar", "rods"), tmp_path / "both.png")) as image:
            colors = {pixel for _, pixel in image.convert("RGB").getcolors(image.width * image.height) or ()}
        drawn = [tuple(int(color[i : i + 2], 16) for i in (1, 3, 5)) for color in segment_colors(2)]
        assert drawn[1] in colors
        # A kinematic worm goes nowhere, and is not in the legend either.
        assert (drawn[0] in colors) == (draw is not travel_figure)


def test_worms_that_go_nowhere_have_no_travel_to_draw(planar_run: Run, tmp_path: Path) -> None:
    with pytest.raises(RunFileError, match="where the worm went"):
        travel_figure([planar_run, planar_run], ("one", "two"), tmp_path / "travel.png")
