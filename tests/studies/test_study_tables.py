"""The tables of studies on a terminal of 80 columns: no number and no word of a head is broken."""

from __future__ import annotations

import re

import pytest
from rich.console import Console
from rich.table import Table

from annelid_studies import pipes, turning

NAN = float("nan")
NONE = NAN, NAN, NAN
SPEEDS, TURNS = (-0.123456, -0.145678, -0.101234), (-12.3456, -14.5678, -10.1234)
TABLES = {
    "pipes": pipes.pipes_table(
        [
            pipes.Reading(*trial[:3], passed, 0.03, *drawn, 0.03, 1.234567, passed, work, slip, "annelid run x")
            for trial in pipes.trials()
            for passed, work, slip, drawn in ((True, 12345.678, 12.3456, SPEEDS), (False, None, None, NONE))
        ]
    ),
    "turning": turning.turning_table(
        [
            turning.Reading(
                gait.name,
                -0.9,
                wave,
                2.6,
                0.03,
                -12.3,
                *drawn,
                -12.3,
                -0.5,
                radius,
                -123.4,
                "annelid run x",
            )
            for gait in turning.GAITS
            for wave, radius, drawn in ((True, 12345.678, TURNS), (False, float("inf"), NONE), (None, NAN, NONE))
        ]
    ),
}


@pytest.mark.parametrize("study", TABLES)
def test_no_cell_breaks_at_80_columns(study: str) -> None:
    table: Table = TABLES[study]
    console = Console(width=80, color_system=None)
    with console.capture() as capture:
        console.print(table)
    lines = capture.get().splitlines()
    assert max(map(len, lines)) <= 80
    assert len(table.columns) <= 8
    shown = {cell for line in lines for cell in re.split(" {2,}", line.strip())}
    words = {word for cell in shown for word in cell.split()}
    for column in table.columns:
        assert set(str(column.header).split()) <= words
        for cell in map(str, column.cells):
            if column.justify == "right":
                assert cell in shown
            else:
                assert set(cell.split()) <= words
