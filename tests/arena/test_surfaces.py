"""The surfaces are exact: closed forms, and distances whose gradient is the unit normal."""

from __future__ import annotations

from math import pi, radians, sin, sqrt, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.arena.ground import surface_of
from annelid.arena.kinds.floor import Floor
from annelid.arena.kinds.pipe import Pipe, PipeWall
from annelid.arena.kinds.relief import Rough, Steps
from annelid.config import ArenaKind
from annelid.protocols import Array

CREASED = {"rails", "steps", "tapering bend"}
"""Some points are as near to the floor as to a rail, or to two steps; a taper has a crease where it begins to curve."""
REACH_M = 0.02
"""How near to the ground the skin is where it matters."""
ARENAS: dict[str, ArenaKind] = {
    "floor": Floor(),
    "slope": Floor(slope_deg=12.0),
    "rails": Floor(rail_gap_m=0.5),
    "steps": Steps(step_height_m=0.05, rounding_m=0.02),
    "rough": Rough(roughness_m=0.01),
    "straight": Pipe(),
    "taper": Pipe(bore_m=0.18, profile="taper"),
    "hourglass": Pipe(bore_m=0.18, profile="hourglass", profile_length_m=1.0),
    "bend": Pipe(course="bend", radius_m=0.4, turn_deg=-90.0),
    "tapering bend": Pipe(bore_m=0.18, course="bend", profile="taper", narrowest_m=0.12, profile_start_m=0.1),
    "s": Pipe(course="s", turn_deg=60.0),
    "helix": Pipe(course="helix", radius_m=0.6, turn_deg=-700.0),
    "waisted helix": Pipe(bore_m=0.18, course="helix", profile="hourglass", turn_deg=540.0, profile_length_m=2.0),
}


def most_kinked(arena: ArenaKind) -> float:
    """Share of points that may lie on a crease: none but for arenas that have one."""
    return 0.01 if arena in [ARENAS[name] for name in CREASED] else 0.0


def places(arena: ArenaKind, seed: int = 0, n: int = 400) -> Array:
    """Points within reach of the ground, on both sides of it."""
    rng = np.random.default_rng(seed)
    off = rng.uniform(-REACH_M, REACH_M, n)
    surface = surface_of(arena)
    if isinstance(arena, Pipe):
        course, bore = arena.centre_line(), arena.bore()
        foot = course.at(rng.uniform(-0.5, 4.0, n))
        across = np.cross(foot.tangent, rng.normal(size=(n, 3)))
        across /= np.linalg.norm(across, axis=-1, keepdims=True)
        return foot.point_m + (bore.at(foot.arc_m)[0] + off)[:, None] * across
    points = np.stack([rng.uniform(-2.0, 0.5, n), rng.uniform(-0.24, 0.24, n), rng.uniform(-0.1, 0.4, n)], axis=-1)
    on_ground = points - surface.distance_m(points)[:, None] * surface.normal(points)
    return on_ground + off[:, None] * surface.normal(on_ground)


def gradient(arena: ArenaKind, points: Array, step: float = 1e-6) -> Array:
    surface = surface_of(arena)
    ends = [surface.distance_m(points + step * e) - surface.distance_m(points - step * e) for e in np.eye(3)]
    return np.stack(ends, axis=-1) / (2 * step)


def test_the_normal_is_the_gradient_of_the_distance_and_has_unit_length(subtests: pytest.Subtests) -> None:
    for arena in ARENAS.values():
        with subtests.test(f"{arena!r:.60}"):
            points = places(arena)
            normal, numerical = surface_of(arena).normal(points), gradient(arena, points)
            assert np.linalg.norm(normal, axis=-1) == pytest.approx(1.0, abs=1e-12)
            kinked = np.abs(np.linalg.norm(numerical, axis=-1) - 1.0) > 1e-6
            assert kinked.mean() <= most_kinked(arena)
            assert np.abs(normal - numerical)[~kinked].max() < 1e-6


def test_no_point_of_the_surface_is_nearer_than_the_distance(subtests: pytest.Subtests) -> None:
    """Against the definition: the least distance to a dense sample of the surface itself."""
    for arena in ARENAS.values():
        with subtests.test(f"{arena!r:.60}"):
            surface, points = surface_of(arena), places(arena, seed=2, n=30)
            distance = surface.distance_m(points)
            feet = points - distance[:, None] * surface.normal(points)
            rng = np.random.default_rng(3)
            for point, foot, own in zip(points, feet, np.abs(distance), strict=True):
                around = foot + rng.uniform(-0.03, 0.03, (200, 3))
                on_it = around - surface.distance_m(around)[:, None] * surface.normal(around)
                on_it = on_it[np.abs(surface.distance_m(on_it)) < 1e-9]
                assert np.linalg.norm(on_it - point, axis=-1).min() > own - 1e-9


@given(st.floats(0.1, 1.3), st.floats(0.0, 2 * pi), st.floats(0.0, pi / 2), st.floats(0.0, 0.09))
def test_a_bend_is_a_torus(radius: float, round_it: float, along: float, off_axis: float) -> None:
    """In the coordinates of the torus, which turns to the worm's left, -y, about an upright axis."""
    arena = Pipe(course="bend", radius_m=radius, bore_m=0.16, entry_clearance_m=0.0)
    out, up = off_axis * np.cos(round_it), off_axis * np.sin(round_it)
    reach = radius + out
    point = np.array([-0.2 - reach * np.sin(along), -radius + reach * np.cos(along), 0.16 + up])
    assert surface_of(arena).distance_m(point) == pytest.approx(0.16 - off_axis, abs=1e-9)


@given(st.floats(0.05, 9.0), st.floats(0.0, 2 * pi), st.floats(0.01, 0.17), st.booleans())
def test_a_helix_is_a_tube_about_its_line(turns_rad: float, round_it: float, off_axis: float, right: bool) -> None:
    """Its own definition: radius and rise about an axis that leans as far as the helix climbs."""
    radius, pitch, sign = 0.6, 0.5, -1.0 if right else 1.0
    arena = Pipe(course="helix", radius_m=radius, pitch_m=pitch, turn_deg=sign * 540.0, entry_clearance_m=0.0)
    rise = pitch / (2 * pi)
    slant = sqrt(radius**2 + rise**2)
    ahead = np.array([-radius, 0.0, -rise]) / slant
    axis = np.array([-rise, 0.0, radius]) / slant
    outwards = np.array([0.0, sign, 0.0])
    radial = np.cos(turns_rad) * outwards + np.sin(turns_rad) * ahead
    around = np.cos(turns_rad) * ahead - np.sin(turns_rad) * outwards
    centre = np.array([-0.2, -sign * radius, 0.16]) + radius * radial + rise * turns_rad * axis
    binormal = (radius * axis - rise * around) / slant
    point = centre + off_axis * (np.cos(round_it) * radial + np.sin(round_it) * binormal)
    expected = 0.16 - off_axis
    assert surface_of(arena).distance_m(point) == pytest.approx(expected, abs=1e-9)


def test_a_taper_is_a_cone_between_its_rounded_ends() -> None:
    arena = Pipe(bore_m=0.18, profile="taper", narrowest_m=0.12, profile_start_m=0.2, profile_length_m=0.5)
    # The rounding of 2 cm at either end leaves the cone's slope at 0.06 over 0.48 m.
    slope = 0.06 / 0.48
    ahead, off_axis, angle = 0.45, 0.1, 0.7
    point = np.array([-ahead, off_axis * np.cos(angle), 0.18 + off_axis * np.sin(angle)])
    radius = 0.18 - slope * (ahead - 0.21)
    assert surface_of(arena).distance_m(point) == pytest.approx((radius - off_axis) / sqrt(1 + slope**2), abs=1e-9)


def test_an_hourglass_is_narrowest_midway_and_a_taper_stays_narrow() -> None:
    for profile, far in (("hourglass", 0.18), ("taper", 0.12)):
        pipe = Pipe(bore_m=0.18, profile=profile, narrowest_m=0.12, profile_start_m=0.2, profile_length_m=1.0)  # type: ignore[arg-type]
        bore = pipe.bore()
        arc = np.linspace(-1.0, 3.0, 4001)
        radius, slope = bore.at(arc)
        assert radius.min() == pytest.approx(0.12, abs=1e-12)
        assert radius[-1] == pytest.approx(far, abs=1e-12)
        assert radius[0] == pytest.approx(0.183, abs=1e-12)
        assert np.abs(np.gradient(radius, arc) - slope).max() < 0.02
    waist = Pipe(bore_m=0.18, profile="hourglass", narrowest_m=0.12, profile_start_m=0.2, profile_length_m=1.0).bore()
    assert waist.at(np.array(0.7))[0] == pytest.approx(0.12)
    # The parabola of the authors: 0.18 - 0.06 (1 - (2 u - 1)^2), at a quarter of its length.
    assert waist.at(np.array(0.45))[0] == pytest.approx(0.18 - 0.06 * 0.75, abs=2e-3)


@pytest.mark.parametrize("name", ["bend", "s", "helix"])
def test_a_centre_line_is_smooth_and_its_arc_length_is_its_length(name: str) -> None:
    course = ARENAS[name].centre_line()
    assert course is not None
    arc = np.linspace(-0.5, 6.0, 20001)
    foot = course.at(arc)
    steps = np.linalg.norm(np.diff(foot.point_m, axis=0), axis=-1)
    assert steps == pytest.approx(arc[1] - arc[0], rel=1e-6)
    chord = np.diff(foot.point_m, axis=0) / steps[:, None]
    assert np.abs(chord - foot.tangent[1:]).max() < 1e-3
    assert course.nearest(foot.point_m).arc_m == pytest.approx(arc, abs=1e-6)


def test_pipes_turn_to_the_side_that_they_say() -> None:
    end = {turn: Pipe(course="bend", turn_deg=turn).centre_line().at(np.array(2.0)).point_m for turn in (90.0, -90.0)}
    assert end[90.0][1] < -0.5
    assert end[-90.0][1] > 0.5
    back = Pipe(course="bend", turn_deg=180.0, radius_m=0.3).centre_line().at(np.array(2.0))
    assert back.tangent == pytest.approx([1.0, 0.0, 0.0], abs=1e-12)
    assert back.point_m[1] == pytest.approx(-0.6)
    parallel = Pipe(course="s", turn_deg=60.0).centre_line().at(np.array(3.0))
    assert parallel.tangent == pytest.approx([-1.0, 0.0, 0.0], abs=1e-12)
    climb = Pipe(course="helix", radius_m=0.6, turn_deg=720.0).centre_line()
    heights = climb.at(np.array([0.2, 0.2 + 2 * 2 * pi * sqrt(0.6**2 + (0.5 / 2 / pi) ** 2)])).point_m[:, 2]
    lean = np.arctan(0.5 / (2 * pi * 0.6))
    assert heights[1] - heights[0] == pytest.approx(2 * 0.5 * np.cos(lean))


def test_steps_rise_where_and_as_they_say() -> None:
    arena = Steps(start_m=0.1, step_height_m=0.05, step_length_m=0.3, rounding_m=0.01, floor_gap_m=0.0)
    ahead = np.array([0.0, 0.25, 0.55, 0.85])
    points = np.stack([-ahead, np.zeros(4), np.array([0.0, 0.05, 0.10, 0.15]) + 0.02], axis=-1)
    assert surface_of(arena).distance_m(points) == pytest.approx([0.02] * 4)
    riser = np.array([-0.09, 0.0, 0.03])
    assert surface_of(arena).distance_m(riser) == pytest.approx(0.01)
    assert surface_of(arena).normal(riser) == pytest.approx([1.0, 0.0, 0.0])
    # In the rounded inner corner, 1 cm from its centre line's far side.
    assert surface_of(arena).distance_m(np.array([-0.09, 0.0, 0.01])) == pytest.approx(0.01)


def test_rough_ground_has_its_roughness_and_correlation() -> None:
    arena = Rough(roughness_m=0.01, correlation_m=0.15, start_m=0.0, floor_gap_m=0.0)
    rng = np.random.default_rng(0)
    lag, squares, products = 0.15, [], []
    for seed in range(60):
        ground = arena.model_copy(update={"relief_seed": seed}).ground()
        here = rng.uniform([-40.0, -20.0], [-1.0, 20.0], (500, 2))
        angle = rng.uniform(0, 2 * pi, 500)
        there = here + lag * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        a, b = ground.height(here)[0], ground.height(there)[0]
        squares.append(np.mean(a * a))
        products.append(np.mean(a * b))
    assert sqrt(np.mean(squares)) == pytest.approx(0.01, rel=0.05)
    assert np.mean(products) / np.mean(squares) == pytest.approx(np.exp(-1.0), abs=0.05)
    assert surface_of(arena).distance_m(np.array([0.2, 0.0, 0.05])) == pytest.approx(0.05)


def test_to_first_order_a_distance_is_as_near_as_stated() -> None:
    for name in ("taper", "hourglass", "tapering bend", "rough"):
        arena = ARENAS[name]
        points = places(arena, seed=4)
        exact = surface_of(arena).distance_m(points)
        near = np.abs(exact) < 0.003
        first, _ = surface_of(arena).nearest(points[near], first_order=True)
        assert np.abs(first - exact[near]).max() < 6e-5


def test_a_slope_leans_gravity_and_leaves_the_ground_level() -> None:
    from annelid.arena.ground import gravity_of

    for arena in (Floor(slope_deg=10.0), Pipe(slope_deg=10.0)):
        pull = gravity_of(arena)
        assert np.linalg.norm(pull) == pytest.approx(9.81)
        # It pulls the worm, which leads towards -x, back down: towards +x.
        assert pull[0] / -pull[2] == pytest.approx(tan(radians(10.0)))
        assert pull[0] == pytest.approx(9.81 * sin(radians(10.0)))
    assert isinstance(surface_of(Pipe()), PipeWall)


@given(st.floats(-pi, pi), st.floats(0.0, 0.5), st.floats(0.01, 0.5))
def test_a_post_is_as_far_as_its_axis_less_its_radius(angle: float, gap_m: float, radius_m: float) -> None:
    surface = surface_of(Floor(posts=((-1.0, 0.3, radius_m), (50.0, 0.0, 1.0))))
    outwards = np.array([np.cos(angle), np.sin(angle), 0.0])
    point = np.array([-1.0, 0.3, 5.0]) + (radius_m + gap_m) * outwards
    assert surface.distance_m(point) == pytest.approx(gap_m, abs=1e-12)
    assert surface.normal(point) == pytest.approx(outwards, abs=1e-9)
    floor = np.array([*point[:2], gap_m / 2 - 0.009])
    assert surface.distance_m(floor) == pytest.approx(gap_m / 2, abs=1e-12)
