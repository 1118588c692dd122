from __future__ import annotations

from io import StringIO
from pathlib import Path

import pytest
from PIL import Image
from rich.console import Console
from rich.table import Table

from annelid.analysis.comparison import compare
from annelid.draw.canvas import segment_colors
from annelid.draw.figures.comparison import lengths_figure, travel_figure
from annelid.draw.summary_table import comparison_table, fields_table
from annelid.errors import RunFileError
from annelid.simulation.runfile import Run


def printed(table: Table) -> str:
    text = StringIO()
    Console(file=text, width=200).print(table)
    return text.getvalue()


def test_the_table_shows_numbers_differences_and_dashes(planar_run: Run, rods_run: Run) -> None:
    comparison = compare([planar_run, rods_run])
    lines = printed(comparison_table(comparison)).splitlines()
    rows = {line.split("  ")[0].strip(): line for line in lines}
    assert "3.000 s" in rows["simulated time"]
    assert "0.200 s" in rows["simulated time"]
    assert any("(-93.3 %)" in line for line in lines)
    assert rows["travel forwards, centre of mass"].split()[5] == "-"
    assert "largest pin gap" not in rows, "no run has one"


def test_the_fields_of_other_kinds_are_left_to_json(planar_run: Run, rods_run: Run) -> None:
    text = printed(fields_table(compare([planar_run, rods_run])))
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
