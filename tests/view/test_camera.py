from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.draw.camera import FIELD_OF_VIEW_DEG, VIEWS_DEG, fitting_distance, view_angles
from annelid.errors import RunFileError

points = st.lists(st.tuples(*[st.floats(-2.0, 2.0)] * 3), min_size=1, max_size=20)


@given(points, st.sampled_from(sorted(VIEWS_DEG)), st.floats(0.5, 3.0))
def test_every_point_is_in_the_picture(offsets: list, view: str, aspect: float) -> None:
    azimuth, elevation = (math.radians(angle) for angle in VIEWS_DEG[view])
    distance = fitting_distance(offsets, *VIEWS_DEG[view], aspect)
    sight = np.array(
        [math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)]
    )
    relative = np.array(offsets) + distance * sight
    depth = relative @ sight
    across = np.cross(sight, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    above = np.cross(across, sight)
    half = math.tan(math.radians(FIELD_OF_VIEW_DEG / 2))
    assert np.all(np.abs(relative @ above) <= half * depth + 1e-9)
    assert np.all(np.abs(relative @ across) <= aspect * half * depth + 1e-9)


def test_an_unknown_view_is_refused_with_the_nearest() -> None:
    with pytest.raises(RunFileError, match="did you mean 'isometric'"):
        view_angles("isometrc")
