from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.analysis.elongation import end_difference, interior_deficit, middle_deficit


def test_deficits_of_the_published_elongations() -> None:
    # The paper, section 3: 4.20, 2.55, 4.02 cm and 39.4 %, from unrounded lengths.
    assert middle_deficit([0.0420, 0.0255, 0.0402]) == pytest.approx(0.394, abs=2e-3)
    assert end_difference([0.0420, 0.0255, 0.0402]) == pytest.approx(0.0445, abs=2e-3)
    # The robot in the paper, section 4: 37.8 and 22.2 % for its two interior segments, 2.75 % for the ends.
    robot = [0.0615, 0.0382, 0.0478, 0.0598]
    assert middle_deficit(robot) == pytest.approx((0.378 + 0.222) / 2, abs=2e-3)
    assert end_difference(robot) == pytest.approx(0.0275, abs=2e-3)


def test_deficits_of_a_worm_that_does_not_elongate_cannot_be_told() -> None:
    assert math.isnan(middle_deficit([0.0, 0.01, 0.0]))
    assert math.isnan(end_difference([0.0, 0.01, 0.0]))


@given(st.lists(st.floats(0.001, 0.1), min_size=3, max_size=8), st.floats(0.1, 10.0))
def test_interior_deficit_knows_neither_unit_nor_direction(lengths: list[float], scale: float) -> None:
    deficit = interior_deficit(lengths)
    assert interior_deficit([scale * length for length in lengths]) == pytest.approx(deficit, abs=1e-9)
    assert interior_deficit(lengths[::-1]) == pytest.approx(deficit, abs=1e-9)
