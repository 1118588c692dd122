from __future__ import annotations

from math import sqrt
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from annelid.draw.figures import experiments as figures
from annelid.draw.figures.experiments import Panel, uncertainty_figure

PANEL = Panel("length (cm)", ["1", "2"], [8.0, 7.0], {"a": [0.3, 0.1], "b": [0.4, None], "c": [1.2, 0.0]})


def test_bars_are_nested_and_end_at_the_root_of_the_sum_of_squares() -> None:
    axes = Figure().subplots()
    figures._draw(axes, PANEL)
    ends: list[list[float]] = [[], []]
    for bars in axes.collections:
        for (place, low), (_, high) in bars.get_segments():  # type: ignore[attr-defined]
            value = PANEL.values[round(place)]
            assert value is not None
            ends[round(place)].append(max(abs(low - value), abs(high - value)))
    # Two pieces of every bar, one up and one down.
    assert sorted(ends[0]) == pytest.approx([0.3, 0.3, sqrt(0.25), sqrt(0.25), 1.3, 1.3])
    assert ends[1] == pytest.approx([0.1] * 6)
    low, high = axes.get_ylim()
    assert low < 6.7
    assert high > 9.3


def test_a_tiny_error_does_not_blow_up_the_axis() -> None:
    axes = Figure().subplots()
    figures._draw(axes, Panel("period (s)", [""], [2.631], {"a": [1e-9], "b": [None], "c": [0.0]}))
    assert np.ptp(axes.get_ylim()) >= 0.02 * 2.631 * (1 - 1e-9)


@pytest.mark.parametrize("value", [2.6, None])
def test_a_picture_is_written_whether_or_not_there_is_a_value(value: float | None, tmp_path: Path) -> None:
    panel = Panel("period (s)", [""], [value], {"a": [0.1], "b": [None], "c": [None]})
    path = uncertainty_figure([PANEL, panel], tmp_path / "u.png")
    assert path.read_bytes().startswith(b"\x89PNG")
