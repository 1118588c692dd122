"""Passages of worms that are laid along the centre line by hand."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.analysis.pipe_passage import Passage, passage_through
from annelid.analysis.track import Track
from annelid.arena.kinds.pipe import Pipe
from annelid.body.mesh import Mesh

GEOMETRY = Mesh(n_segments=6, planes_between_rings=3, free_planes_at_ends=2).geometry()
SPACING_M, RADIUS_M = 0.11, 0.12


def laid(pipe: Pipe, time_s: np.ndarray, front_m: np.ndarray) -> Track:
    """A worm whose rings are circles about the centre line, evenly spaced behind a front that moves as it is told."""
    course, angle = pipe.centre_line(), 2 * pi * np.arange(GEOMETRY.n_per_plane) / GEOMETRY.n_per_plane
    crossing = np.zeros((len(time_s), len(GEOMETRY.crossings_m), 3))
    for segment, ring in enumerate(GEOMETRY.rings):
        foot = course.at(front_m - segment * SPACING_M)
        side = np.cross(foot.tangent, [0.0, 0.0, 1.0])
        side /= np.linalg.norm(side, axis=-1, keepdims=True)
        up = np.cross(side, foot.tangent)
        around = np.cos(angle)[:, np.newaxis] * side[:, np.newaxis] + np.sin(angle)[:, np.newaxis] * up[:, np.newaxis]
        crossing[:, ring] = foot.point_m[:, np.newaxis] + RADIUS_M * around
    planes = tuple(int(ring[0]) // GEOMETRY.n_per_plane for ring in GEOMETRY.rings)
    return Track(time_s, crossing, GEOMETRY.n_per_plane, planes)


PIPES = (
    Pipe(bore_m=0.18, profile="taper"),
    Pipe(bore_m=0.18, course="bend", radius_m=0.4),
    Pipe(bore_m=0.18, course="bend", radius_m=1.3, turn_deg=-90.0, profile="hourglass", profile_length_m=1.0),
    Pipe(bore_m=0.18, course="helix", radius_m=0.6, turn_deg=540.0),
)


@pytest.mark.parametrize("pipe", PIPES, ids=lambda pipe: f"{pipe.course}, {pipe.profile}")
@settings(max_examples=20)
@given(start=st.floats(-0.1, 0.3), speed=st.floats(0.01, 0.3))
def test_rings_are_where_they_were_laid_and_speed_is_along_the_line(pipe: Pipe, start: float, speed: float) -> None:
    time = np.arange(0.0, 8.0, 0.1)
    front = start + speed * time
    passage = passage_through(pipe, laid(pipe, time, front))
    assert passage.ring_arc_m == pytest.approx(front[:, np.newaxis] - SPACING_M * np.arange(6), abs=1e-9)
    assert passage.speed_over_m_per_s(1.0) == pytest.approx(np.full(len(time), speed), rel=1e-6)
    if front[-1] > pipe.straight_m + 2 * speed:
        assert passage.speed_m_per_s() == pytest.approx(speed, rel=1e-6)


def test_the_bore_is_that_at_the_ring() -> None:
    pipe = PIPES[0]
    passage = passage_through(pipe, laid(pipe, np.array([0.0, 1.0]), np.array([-0.2, 2.0])))
    assert passage.bore_m[0] == pytest.approx(np.full(6, pipe.bore_m + pipe.entry_clearance_m))
    assert passage.bore_m[1] == pytest.approx(np.full(6, pipe.narrowest_m))


def passage_with(middle_m: list[float]) -> Passage:
    middle = np.array(middle_m)
    return Passage(
        np.arange(len(middle), dtype=float), np.stack([middle + 0.3, middle - 0.3], axis=1), middle, (0.5, 1)
    )


def test_speed_is_the_front_s_between_its_arrival_and_its_departure() -> None:
    # The foremost ring is 0.3 m ahead of the middle; the part lies between 0.5 and 1 m.
    #                    arrives  ......  is out
    there = passage_with([0.0, 0.25, 0.5, 0.75, 1.05, 1.1, 1.1])
    assert there.passed
    assert there.speed_m_per_s() == pytest.approx(0.5 / 2)
    stuck = passage_with([0.0, 0.25, 0.5, 0.5, 0.5])
    assert not stuck.passed
    assert stuck.speed_m_per_s() == pytest.approx(0.25 / 3)
    away = passage_with([0.0, 0.1, 0.1])
    assert np.isnan(away.speed_m_per_s())
