"""The check before a run: what it finds, that its estimates hold, and that what it says to set instead helps."""

from __future__ import annotations

import re
import tomllib
from math import asin, hypot
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.analysis import rhythm_score
from annelid.analysis.rhythm import DESIGN_INTERVAL_S
from annelid.body.estimates import WALKS_FROM, bearable_force_N, rhombus_of
from annelid.body.worm import WormBody
from annelid.config import LEVELS, RunConfig, arena_names, load_config, preset_names
from annelid.errors import ConfigError
from annelid.morphology import helical_mesh, rhombus
from annelid.plausibility import check, refuse_nonsense
from annelid.simulation import simulate
from rods import tolerance_window_m

Changes = dict[str, Any]
NONSENSE: list[tuple[str, Changes, str]] = [
    ("riddle2025", {"body.mesh.radius_m": 0.05}, "body.rings.length_range_m"),
    ("riddle2025-muscles", {"body.mesh.radius_m": 0.05}, "body.rings.length_range_m"),
    ("wang", {"body.mesh.radius_m": 0.05}, "body.rings.length_range_m"),
    ("riddle2023-rods", {"body.mesh.radius_m": 0.05}, "body.rings.length_range_m"),
    ("riddle2025", {"body.mesh.radius_m": 0.3}, "body.rings.length_range_m"),
    (
        "riddle2025-muscles",
        {"arena.slope_deg": 32.6, "body.mesh.radius_m": 0.307195, "body.mesh.angular_rate_rad_per_m": 25.95235},
        "body.rings.length_range_m",
    ),
    ("riddle2023-rods", {"body.mesh.n_helices": 96, "body.strands.radius_m": 0.006}, "body.mesh.n_helices"),
]
DOUBTFUL: list[tuple[str, Changes, str]] = [
    ("riddle2023", {"body.rings.peak_force_N": 615.445477, "body.mesh.n_helices": 8}, "body.rings.peak_force_N"),
    ("riddle2023-rods", {"body.mesh.angular_rate_rad_per_m": 25.241869}, "body.mesh.angular_rate_rad_per_m"),
    ("riddle2023-rods", {"body.mesh.angular_rate_rad_per_m": 2.0}, "body.mesh.angular_rate_rad_per_m"),
    ("riddle2023-rods", {"body.mesh.n_helices": 6, "body.mesh.elements_per_side": 1}, "body.mesh.elements_per_side"),
    ("riddle2023-rods", {"body.springs.rest_length_m": 0.2}, "body.springs.rest_length_m"),
    ("riddle2023-rods", {"body.strands.young_modulus_Pa": 1e12}, "body.strands.young_modulus_Pa"),
    ("riddle2023-fast", {"body.strands.young_modulus_Pa": 1e9}, "body.strands.shear_modulus_Pa"),
    ("riddle2023-rods", {"body.strands.linear_density_kg_per_m": 5.0}, "body.strands.linear_density_kg_per_m"),
    ("riddle2023-rods", {"clock.physics_timestep_s": 0.1}, "clock.physics_timestep_s"),
    ("riddle2023-rods", {"arena.contact_time_constant_s": 0.002}, "arena.contact_time_constant_s"),
    ("riddle2023-rods", {"arena.slope_deg": 20.0, "arena.friction": 0.1}, "arena.slope_deg"),
    ("riddle2023-fast", {"arena.slope_deg": 5.0}, "body.formulation.friction_impedance_ratio"),
    ("riddle2023", {"arena.slope_deg": 5.0}, "body.formulation.kind"),
    ("riddle2023-rods", {"sensor.tolerance_m": 0.07}, "sensor.tolerance_m"),
    ("riddle2023-rods", {"sensor.tolerance_m": 0.0005}, "sensor.tolerance_m"),
    ("riddle2023-rods", {"sensor.tolerance_m": 0.2}, "sensor.tolerance_m"),
    ("riddle2023", {"clock.physics_timestep_s": 0.02}, "clock.physics_timestep_s"),
    ("riddle2023", {"body.formulation.armature_kg_m2": 0.0}, "clock.physics_timestep_s"),
    ("riddle2023", {"body.formulation.pin_time_constant_s": 0.001}, "body.formulation.pin_time_constant_s"),
    ("wang", {"body.rings.length_range_m": [0.95, 0.96]}, "body.rings.length_range_m"),
    ("wang", {"body.rings.length_range_m": [0.62, 0.9]}, "body.rings.length_range_m"),
    ("riddle2023-rods", {"body.rings.length_range_m": [0.42, 0.81]}, "body.rings.length_range_m"),
    ("wang", {"body.rings.length_range_m": [0.62, 1.6]}, "body.rings.length_range_m"),
    ("wang", {"body.rings.force_limit_N": 40.0, "body.rings.length_range_m": [0.1, 0.96]}, "body.rings.force_limit_N"),
    ("riddle2023-rods", {"body.rings.minimum_length": 0.45}, "body.rings.peak_force_N"),
]


@given(half=st.integers(3, 16), radius=st.floats(0.02, 0.5), rate=st.floats(3.0, 40.0), elements=st.integers(1, 6))
def test_the_rhombus_is_that_of_the_mesh(half: int, radius: float, rate: float, elements: int) -> None:
    shape = rhombus(2 * half, radius, rate, elements)
    mesh = helical_mesh(3, n_helices=2 * half, radius_m=radius, angular_rate_rad_per_m=rate, elements_per_side=elements)
    side = mesh.crossing_vertex[:2]
    edges = mesh.vertices_m[0, side[0] : side[1] + 1]
    assert shape.ring_length_m == pytest.approx(mesh.ring_length_m[0])
    assert shape.along_m == pytest.approx(mesh.spring_length_m[0])
    assert shape.side_m == pytest.approx(sum(hypot(*edge) for edge in edges[1:] - edges[:-1]))


def test_the_estimate_of_the_mesh_follows_the_authors_load_frame() -> None:
    """Force at 10, 20, .. 100 mm of diameter, as their simulation of E 2 GPa and radius 2.99 mm has it, N."""
    body = load_config("riddle2025-muscles").body
    assert isinstance(body, WormBody)
    shape = rhombus_of(body)
    for number, force_N in enumerate((3.06, 5.27, 6.88, 8.40, 9.69, 10.91, 11.98, 12.89, 14.01, 15.04), start=1):
        across = (shape.ring_length_m - 3 * 0.01 * number) / shape.n_per_plane
        opening = asin(across / hypot(shape.across_m, shape.along_m))
        assert bearable_force_N(body, opening / shape.opening_rad) == pytest.approx(force_N, rel=0.15)
    assert bearable_force_N(body) == pytest.approx(15.0, rel=0.15), "measured: rings collapse at 14 to 16 N"


def test_nothing_is_found_in_a_preset_in_an_arena_or_at_a_level() -> None:
    assert {name: found for name in preset_names() if (found := check(load_config(name)))} == {}
    for arena in arena_names():
        assert check(load_config("riddle2023-rods", arena=arena)) == []
    for level in LEVELS:
        assert check(load_config("riddle2023-rods", fidelity=level)) == []


@pytest.mark.parametrize(
    ("slope_deg", "friction", "backward", "slides"),
    [(20.0, 0.2, 1.0, False), (20.0, 1.0, 0.1, True), (-20.0, 0.2, 1.0, True), (20.0, 1.0, None, False)],
)
def test_setae_hold_on_a_slope_against_the_way_they_point(
    slope_deg: float, friction: float, backward: float | None, slides: bool
) -> None:
    changes = {"arena.slope_deg": slope_deg, "arena.friction": friction, "arena.backward_friction": backward}
    found = check(load_config("riddle2023-rods", changes))
    assert [finding.field for finding in found] == ["arena.slope_deg"] * slides


def test_what_can_mean_nothing_is_an_error_until_it_is_set_as_said(subtests: pytest.Subtests) -> None:
    for preset, changes, field in NONSENSE:
        with subtests.test(f"{preset!r:.60}"):
            config = load_config(preset, changes)
            found = next(finding for finding in check(config) if finding.severity == "error")
            assert found.field == field
            with pytest.raises(ConfigError, match=re.escape(f"{field} = ")):
                refuse_nonsense(config)
            better = re.search(r"set (\[.*?\])", found.instead)
            if better:
                mended = load_config(preset, {**changes, field: tomllib.loads(f"x = {better[1]}")["x"]})
                assert field not in [finding.field for finding in check(mended)]


def test_what_is_doubtful_is_a_warning_with_a_number(subtests: pytest.Subtests) -> None:
    for preset, changes, field in DOUBTFUL:
        with subtests.test(f"{preset!r:.60}"):
            config = load_config(preset, changes)
            assert [finding.severity for finding in check(config) if finding.field == field] == ["warning"]
            assert any(re.search(r"\d", finding.instead) for finding in check(config) if finding.field == field)
            assert any(sentence.startswith(f"{field} = ") for sentence in refuse_nonsense(config))


STRANDS = "body.strands."
MEASURED_WINDOWS = np.genfromtxt(
    Path(__file__).parents[1] / "docs" / "results" / "tolerance_windows.csv", delimiter=",", skip_header=1
)[:, :5].tolist()
"""Modulus, GPa, friction and damping time, s; lift by the neighbours and length in passing, mm."""


def of_rods(modulus_GPa: float, friction: float = 1.0, damping_s: float = 0.145, **more: Any) -> RunConfig:
    """The rods with another material on another floor."""
    changes = {
        STRANDS + "young_modulus_Pa": 1e9 * modulus_GPa,
        STRANDS + "shear_modulus_Pa": 1e9 * modulus_GPa / 1.5,
        STRANDS + "damping_time_s": damping_s,
        "arena.friction": friction,
        **more,
    }
    return load_config("riddle2023-rods", changes)


def window_of(config: RunConfig) -> tuple[float, float]:
    found = tolerance_window_m(config)
    assert found is not None
    return found


def test_the_window_of_tolerances_follows_what_was_measured(subtests: pytest.Subtests) -> None:
    for modulus_GPa, friction, damping_s, lift_mm, passing_mm in MEASURED_WINDOWS:
        with subtests.test(f"{modulus_GPa!r:.60}"):
            low_m, high_m = window_of(of_rods(modulus_GPa, friction, damping_s))
            assert 1e3 * low_m / WALKS_FROM == pytest.approx(lift_mm, abs=7.0)
            assert 1e3 * high_m == pytest.approx(passing_mm, abs=4.0)


@given(st.floats(0.3, 2.0), st.floats(1.0, 2.0), st.floats(0.05, 1.5), st.floats(1.0, 5.0), st.floats(0.05, 0.36))
def test_stiffer_strands_more_damping_and_less_friction_need_more_tolerance(
    modulus_GPa: float, stiffer: float, friction: float, slippier: float, damping_s: float
) -> None:
    low_m, high_m = window_of(of_rods(modulus_GPa, friction, damping_s))
    for changed in (
        of_rods(modulus_GPa * stiffer, friction, damping_s),
        of_rods(modulus_GPa, friction / slippier, damping_s),
        of_rods(modulus_GPa, friction, min(damping_s * stiffer, 0.4)),
    ):
        lower_m, upper_m = window_of(changed)
        assert lower_m >= low_m
        assert upper_m >= high_m


@pytest.mark.parametrize("damping_s", [0.04, 0.5, 50.0])
def test_nothing_is_said_of_dampings_that_were_not_measured(damping_s: float) -> None:
    assert tolerance_window_m(of_rods(0.3, 1.0, damping_s)) is None


def test_nothing_is_said_of_muscles_that_act_at_once() -> None:
    assert tolerance_window_m(of_rods(0.3, **{"body.rings.activation_dynamics": False})) is None


def test_a_tolerance_outside_its_window_is_found_until_it_is_set_as_said() -> None:
    field = "sensor.tolerance_m"
    assert check(of_rods(0.8, 0.1, **{field: 0.045})) == []
    for tolerance_m in (0.015, 0.065):
        [finding] = check(of_rods(0.8, 0.1, **{field: tolerance_m}))
        assert finding.field == field
        better = re.search(r"set about ([\d.]+)", finding.instead)
        assert better
        assert check(of_rods(0.8, 0.1, **{field: float(better[1])})) == []


@pytest.mark.slow
@pytest.mark.parametrize(("modulus_GPa", "friction"), [(0.3, 1.0), (0.8, 0.3), (1.2, 1.0), (2.0, 0.05)])
def test_the_worm_walks_within_the_window_and_not_outside(modulus_GPa: float, friction: float, tmp_path: Path) -> None:
    low_m, high_m = window_of(of_rods(modulus_GPa, friction))
    for tolerance_m, walks in (
        (low_m + 0.004, True),
        ((low_m + high_m) / 2.0, True),
        (high_m - 0.004, True),
        (low_m - 0.006, False),
        (high_m + 0.006, False),
    ):
        config = of_rods(modulus_GPa, friction, **{"sensor.tolerance_m": tolerance_m, "duration_s": 8.0})
        found = rhythm_score(simulate(config, tmp_path / f"{tolerance_m:.4f}", progress=False))
        in_time = found.period_s is not None and abs(found.period_s / (3 * DESIGN_INTERVAL_S) - 1.0) < 0.1
        assert (found.verdict == "ordered" and in_time) == walks, tolerance_m


def test_no_tolerance_is_suggested_where_none_is_known_to_do() -> None:
    [finding] = check(of_rods(3.0, 0.3, 0.36))
    assert "no tolerance is known" in finding.problem


def test_bodies_that_were_not_measured_have_no_window(subtests: pytest.Subtests) -> None:
    for name in ("riddle2023", "riddle2023-fast", "riddle2025", "riddle2025-muscles", "wang"):
        with subtests.test(f"{name!r:.60}"):
            assert tolerance_window_m(load_config(name)) is None
