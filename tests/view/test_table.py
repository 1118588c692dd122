from __future__ import annotations

from dataclasses import replace
from io import StringIO

import pytest
from rich.console import Console

from annelid.analysis.summary import Summary, summary
from annelid.simulation.runfile import Run
from annelid.view.table import summary_table


def printed(run: Run, numbers: Summary, width: int) -> list[str]:
    text = StringIO()
    Console(file=text, width=width).print(summary_table(numbers, run.config))
    return text.getvalue().splitlines()


@pytest.mark.parametrize("width", [40, 50, 60, 100])
def test_our_numbers_stay_in_a_narrow_terminal(planar_run: Run, width: int) -> None:
    numbers = replace(summary(planar_run), period_s=2.125, period_std_s=None, order=[1, 2, 3], onsets_s=[0.0, 0.5, 1.0])
    lines = printed(planar_run, numbers, width)
    assert any("this run" in line for line in lines)
    assert any("2.125 s" in line for line in lines)
    assert "3 at 1.00" in " ".join(" ".join(lines).split())
    assert max(len(line) for line in lines) <= width


def test_no_number_is_minus_zero(rods_run: Run) -> None:
    numbers = replace(summary(rods_run), travel_m=-1e-6, travel_path_m=-0.002)
    text = "\n".join(printed(rods_run, numbers, 120))
    assert "-0.0 mm" not in text
    assert "0.0 mm" in text
    assert "-2.0 mm" in text
