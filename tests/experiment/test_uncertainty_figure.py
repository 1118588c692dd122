from __future__ import annotations

from math import nan, sqrt

import numpy as np
import pytest
from matplotlib.figure import Figure

from annelid.draw.figures.experiments import _draw_nested


def test_bars_are_nested_and_end_at_the_root_of_the_sum_of_squares() -> None:
    values = np.array([8.0, 7.0])
    axes = Figure().subplots()
    _draw_nested(axes, values, {"a": np.array([0.3, 0.1]), "b": np.array([0.4, nan]), "c": np.array([1.2, 0.0])})
    ends: list[list[float]] = [[], []]
    for bars in axes.collections:
        for (place, low), (_, high) in bars.get_segments():  # type: ignore[attr-defined]
            assert low + high == pytest.approx(2.0 * values[round(place)])
            ends[round(place)].append((high - low) / 2.0)
    assert ends[0] == pytest.approx([0.3, sqrt(0.25), 1.3])
    assert ends[1] == pytest.approx([0.1] * 3)
    inner, outer = (bars.get_zorder() for bars in axes.collections[::2])
    assert inner > outer, "a long bar does not hide a short one"
    low, high = axes.get_ylim()
    assert low < 6.7
    assert high > 9.3


def test_a_tiny_error_does_not_blow_up_the_axis() -> None:
    axes = Figure().subplots()
    _draw_nested(axes, np.array([2.631]), {"a": np.array([1e-9]), "b": np.array([nan]), "c": np.array([0.0])})
    assert np.ptp(axes.get_ylim()) >= 0.02 * 2.631 * (1 - 1e-9)
