"""Tracks of worms that are moved by hand: headings, outlines, and turns in closed form."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from annelid.analysis.track import Track, track_of
from annelid.body.mesh import Mesh
from annelid.body.worm import WormBody
from annelid.config import load_config
from annelid.errors import RunFileError
from annelid.simulation import simulate
from annelid_studies.turning import turn_of

MESH = Mesh(n_segments=6, planes_between_rings=3, free_planes_at_ends=2)
GEOMETRY = MESH.geometry()
N_PER_PLANE, RINGS = GEOMETRY.n_per_plane, tuple(GEOMETRY.ring_planes.tolist())
PERIOD_S = 3.0


def moved(time_s: np.ndarray, angle_rad: np.ndarray, x_m: np.ndarray, y_m: np.ndarray) -> Track:
    """The worm at rest, turned to the left by an angle about its middle, which is then put somewhere."""
    rest = GEOMETRY.crossings_m - GEOMETRY.crossings_m.mean(axis=0)
    cos, sin = np.cos(angle_rad)[:, np.newaxis], np.sin(angle_rad)[:, np.newaxis]
    # A turn to the left of what leads towards -x takes -x towards -y.
    x = cos * rest[:, 0] - sin * rest[:, 1] + x_m[:, np.newaxis]
    y = sin * rest[:, 0] + cos * rest[:, 1] + y_m[:, np.newaxis]
    return Track(time_s, np.stack([x, y, np.broadcast_to(rest[:, 2], x.shape)], axis=-1), N_PER_PLANE, RINGS)


def on_a_circle(curvature_per_m: float, speed_m_per_s: float, duration_s: float, swing_rad: float = 0.0) -> Track:
    """A worm that crawls on a circle, to the left if its curvature is positive, and swings within its cycle."""
    time = np.arange(0.0, duration_s + 1e-9, 0.05)
    way = speed_m_per_s * time
    angle = curvature_per_m * way
    chord = way * np.sinc(angle / 2.0 / np.pi)
    swing = swing_rad * np.sin(2.0 * np.pi * time / PERIOD_S)
    return moved(time, angle + swing, -chord * np.cos(angle / 2.0), -chord * np.sin(angle / 2.0))


@settings(max_examples=30)
@given(st.floats(-1.5, 1.5), st.floats(0.02, 0.2), st.floats(0.0, 0.1))
def test_the_turn_of_a_circle_is_its_curvature_whatever_the_swing(curvature: float, speed: float, swing: float) -> None:
    turn = turn_of(on_a_circle(curvature, speed, 20.0, swing), PERIOD_S, after_s=1.0)
    assert turn.cycles == 5
    assert turn.angle_rad == pytest.approx(curvature * speed * 5 * PERIOD_S, abs=1e-4)
    # Chords of the arcs of a cycle are that much shorter than the arcs.
    chord = np.sinc(curvature * speed * PERIOD_S / 2.0 / np.pi)
    assert turn.path_m == pytest.approx(speed * 5 * PERIOD_S * chord, rel=1e-4)


@settings(max_examples=20)
@given(st.floats(-10.0, 10.0), st.floats(-3.1, 3.1), st.floats(-0.5, 0.5))
def test_roll_is_the_angle_about_the_body_beyond_whole_turns_whatever_its_heading_and_pitch(
    roll: float, heading: float, pitch: float
) -> None:
    """A worm that leads towards -x has its left side at -y, which a positive roll lifts."""
    rest = GEOMETRY.crossings_m - GEOMETRY.crossings_m.mean(axis=0)
    rolls = roll * np.linspace(0.0, 1.0, 8)
    lies = Rotation.from_euler("z", heading) * Rotation.from_euler("y", pitch)
    postures = [(lies * Rotation.from_euler("x", -angle)).apply(rest) for angle in rolls]
    track = Track(np.arange(8.0), np.stack(postures), N_PER_PLANE, RINGS)
    assert track.roll_rad == pytest.approx(rolls, abs=1e-9)


def test_a_straight_way_has_no_radius_and_a_left_turn_is_positive() -> None:
    assert turn_of(on_a_circle(0.0, 0.1, 20.0), PERIOD_S).radius_m > 1e6
    left = turn_of(on_a_circle(0.5, 0.1, 20.0), PERIOD_S)
    assert left.curvature_per_m > 0
    assert left.radius_m == pytest.approx(2.0, rel=1e-2)


def test_a_turn_takes_two_cycles() -> None:
    with pytest.raises(RunFileError, match="at least two cycles of 3 s, not the 5 s"):
        turn_of(on_a_circle(0.5, 0.1, 6.0), PERIOD_S, after_s=1.0)


def test_headings_are_unwrapped_and_the_front_leads() -> None:
    track = on_a_circle(2.0, 0.2, 20.0)
    assert track.heading_rad[0] == pytest.approx(0.0, abs=1e-9)
    assert track.heading_rad[-1] == pytest.approx(2.0 * 0.2 * 20.0, abs=1e-6)
    ahead = track.front_m - track.middle_m
    assert np.allclose(np.arctan2(-ahead[:, 1], -ahead[:, 0]), np.angle(np.exp(1j * track.heading_rad)), atol=0.02)


@settings(max_examples=10)
@given(st.floats(-math.pi, math.pi))
def test_the_outline_is_as_long_and_wide_as_the_mesh_however_it_lies(angle: float) -> None:
    track = moved(np.zeros(1), np.array([angle]), np.array([3.0]), np.array([-2.0]))
    outline = track.outline_m(0)
    assert np.array_equal(outline[0], outline[-1])
    inwards = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    length, width = np.ptp((outline - [3.0, -2.0]) @ inwards, axis=0)
    rest = np.ptp(GEOMETRY.crossings_m, axis=0)
    assert (length, width) == (pytest.approx(rest[0]), pytest.approx(rest[1]))


def test_rings_of_a_run_are_those_of_its_mesh(tmp_path: Path) -> None:
    config = load_config("riddle2023-rods", {"duration_s": 0.1})
    run = simulate(config, tmp_path / "run", progress=False)
    assert isinstance(config.body, WormBody)
    geometry, track = config.body.geometry(), track_of(run)
    assert track.ring_planes == tuple(geometry.ring_planes)
    first = run.data["crossing_position"].values[:, geometry.rings[0], :2].mean(axis=1)
    assert np.allclose(track.front_m, first, atol=1e-12)


def test_planar_worms_have_no_track(tmp_path: Path) -> None:
    run = simulate(load_config("riddle2022-planar", {"duration_s": 0.1}), tmp_path / "run", progress=False)
    with pytest.raises(RunFileError, match="has no track: only the 3D worm"):
        track_of(run)
