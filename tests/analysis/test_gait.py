"""The gait of runs that are written down rather than simulated: every number is known in closed form."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from annelid.analysis import Energy, Gait, energy_balance, gait, summary
from annelid.analysis.track import fitted_circle
from annelid.config import check_config
from annelid.draw.summary_table import summary_rows
from annelid.simulation.runfile import Run
from synthetic import wave_data

MASS_KG, LENGTH_M = 2.0, 0.5


def run_of(data: xr.Dataset, **tree: Any) -> Run:
    config = check_config({"name": "riddle2023"} | tree)
    return Run(Path("run.nc"), {}, {}, config, "complete", "").with_data(data)


def walking(duration_s: float = 12.0, **signals: Any) -> xr.Dataset:
    """A wave of 2.4 s that walks 1 cm/s towards -x; signals are functions of time, with their dimensions."""
    data = wave_data(duration_s=duration_s).assign_attrs(total_mass_kg=MASS_KG, body_length_m=LENGTH_M)
    time = data["time"].values
    for name, (dims, values) in signals.items():
        data[name] = (dims, values(time))
    return data


def columns(*functions: Any) -> Any:
    return lambda t: np.stack([f(t) + 0 * t for f in functions], axis=-1)


def test_speed_and_stride_leave_out_the_start() -> None:
    """The worm stands during its first cycle and then walks; onsets of segment 1 are 2.4 s apart."""
    place = ("time", "axis"), columns(lambda t: -0.01 * np.maximum(t - 2.4, 0.0), lambda t: 0.0, lambda t: 0.16)
    read = gait(run_of(walking(center_of_mass=place)))
    assert (read.start_s, read.end_s, read.cycles) == (pytest.approx(2.4), pytest.approx(12.0), 4)
    assert read.gait_period_s == pytest.approx(2.4)
    assert read.speed_m_per_s == pytest.approx(0.01)
    assert read.speed_body_lengths_per_s == pytest.approx(0.02)
    assert read.stride_m == pytest.approx(0.024)
    assert read.stride_body_lengths == pytest.approx(0.048)
    assert read.backward_ratio == 0.0
    assert read.lateral_drift == pytest.approx(0.0, abs=1e-12)
    assert read.turning_radius_m is None


def test_a_worm_that_crawls_backwards_has_a_negative_speed_and_no_way_ahead() -> None:
    place = ("time", "axis"), columns(lambda t: 0.02 * t, lambda t: 0.0, lambda t: 0.0)
    read = gait(run_of(walking(center_of_mass=place)))
    assert read.speed_m_per_s == pytest.approx(-0.02)
    assert read.backward_ratio is None


def test_drift_is_positive_to_the_left_which_is_minus_y() -> None:
    place = ("time", "axis"), columns(lambda t: -0.01 * t, lambda t: -0.002 * t, lambda t: 0.0)
    assert gait(run_of(walking(center_of_mass=place))).lateral_drift == pytest.approx(0.2)


def test_slip_contact_and_costs_in_closed_form() -> None:
    """Two of three segments slide by 1 and 2 mm/s under a worm of 10 mm/s; a muscle works at 3 W."""
    data = walking(
        slip_distance=(("time", "segment"), columns(lambda t: 0.001 * t, lambda t: 0.002 * t, lambda t: 0.0)),
        contact_force=(
            ("time", "segment", "axis"),
            lambda t: np.stack([columns(lambda t: 0, lambda t: 0, on)(t) for on in DUTIES], axis=1),
        ),
        muscle_work=(("time", "muscle"), columns(lambda t: 3.0 * t, lambda t: 0.5 * t, lambda t: -0.5 * t)),
    )
    read = gait(run_of(data))
    assert read.slip_ratio == pytest.approx(0.1, rel=1e-3)
    assert read.contact_duty == pytest.approx([1.0, 0.5, 0.0], abs=0.01)
    weight = MASS_KG * 9.81 * 0.01
    assert read.cost_of_transport == pytest.approx(3.5 / weight, rel=2e-3), "work taken up is not regained"
    assert read.cost_of_transport_net == pytest.approx(3.0 / weight, rel=2e-3)
    data["positive_work"] = data["muscle_work"] * 2.0
    assert gait(run_of(data)).cost_of_transport == pytest.approx(6.0 / weight, rel=2e-3), "a file's own sum comes first"
    assert energy_balance(run_of(data).variables) == Energy(), "work alone is no balance"


DUTIES = (lambda t: 1.0 + 0 * t, lambda t: (t % 2.4 < 1.2).astype(float), lambda t: 0.0 * t)


def test_the_cables_cost_is_force_times_half_of_every_change() -> None:
    """One of three cables of 4 N is drawn in and let out at 0.1 m/s, always taut."""
    data = walking(
        muscle_force=(("time", "muscle"), columns(lambda t: 4.0, lambda t: 0.0, lambda t: 0.0)),
        ring_length=(
            ("time", "muscle"),
            columns(lambda t: 1.0 - 0.1 * np.abs(t % 1.2 - 0.6), lambda t: 0.1 * t, lambda t: 1),
        ),
    )
    expected = 4.0 * 0.1 / 2 / (MASS_KG * 9.81 * 0.01)
    assert gait(run_of(data)).cost_of_transport_cables == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_worm_on_a_circle_turns_by_its_radius(side: float) -> None:
    """Radius 2 m at 1 cm/s: a left turn, seen from above, is towards -y for a worm that leads towards -x."""
    angle = 0.01 / 2.0
    place = (
        ("time", "axis"),
        columns(lambda t: -2.0 * np.sin(angle * t), lambda t: -side * 2.0 * (1 - np.cos(angle * t)), lambda t: 0.0),
    )
    read = gait(run_of(walking(60.0, center_of_mass=place)))
    assert read.turning_radius_m == pytest.approx(side * 2.0, rel=1e-6)


def test_a_straight_track_that_swings_has_no_radius() -> None:
    swing = ("time", "axis"), columns(lambda t: -0.01 * t, lambda t: 0.005 * np.sin(9.0 * t), lambda t: 0.0)
    assert gait(run_of(walking(center_of_mass=swing))).turning_radius_m is None


@given(
    radius=st.floats(0.05, 50.0),
    start=st.floats(0.0, 6.28),
    angle=st.floats(0.2, 6.0),
    turn=st.sampled_from([-1, 1]),
    x=st.floats(-20.0, 20.0),
    y=st.floats(-20.0, 20.0),
)
def test_a_circle_is_found_wherever_its_arc_lies(
    radius: float, start: float, angle: float, turn: int, x: float, y: float
) -> None:
    along = start + turn * np.linspace(0.0, angle, 50)
    circle = fitted_circle(np.stack([x + radius * np.cos(along), y + radius * np.sin(along)], axis=-1))
    assert circle is not None
    assert circle.is_clear
    assert circle.radius_m == pytest.approx(radius, rel=1e-5)
    assert circle.centre_m == pytest.approx((x, y), abs=1e-4 * radius)
    assert circle.angle_rad == pytest.approx(turn * angle, rel=1e-4)
    assert circle.signed_radius_m == pytest.approx(turn * radius, rel=1e-5)


@pytest.mark.parametrize("points", [[[0, 0], [1, 1]], [[0, 0], [1, 1], [2, 2], [3, 3]], [[1, 1]] * 5])
def test_points_without_a_circle_have_none(points: list[list[float]]) -> None:
    assert fitted_circle(points) is None


def test_the_balance_splits_what_the_books_say() -> None:
    data = walking(
        muscle_work=(("time", "muscle"), columns(lambda t: 1.0 + 2.0 * t, lambda t: t, lambda t: 0.0)),
        kinetic_energy=(("time",), lambda t: 0.1 * t),
        elastic_energy=(("time",), lambda t: 5.0 + 0.2 * t),
        potential_energy=(("time",), lambda t: 7.0 - 0.3 * t),
        damping_loss=(("time",), lambda t: 0.9 * t),
        constraint_loss=(("time",), lambda t: 1.0 * t),
        slip_loss=(("time", "segment"), columns(lambda t: 0.3 * t, lambda t: 0.3 * t, lambda t: 0.0)),
    )
    balance = energy_balance(run_of(data).variables)
    assert balance.energy_muscle_work_J == pytest.approx(36.0)
    parts = ("kinetic", "elastic", "potential", "slip", "constraints", "damping", "numerical")
    read = [getattr(balance, f"energy_{part}_J") for part in parts]
    assert read == pytest.approx([1.2, 2.4, -3.6, 7.2, 4.8, 10.8, 13.2])
    assert balance.energy_numerical_share == pytest.approx(13.2 / 36.0)
    rows = {row.label: row.ours for row in summary_rows(summary(run_of(data)), run_of(data).config)}
    assert rows["work goes to (%)"] == "stored 0, slip 20, contact 13, damping 30, step error 37"


def test_a_planar_worm_s_balance_needs_no_weight() -> None:
    data = walking(
        muscle_work=(("time", "muscle"), columns(lambda t: t, lambda t: t, lambda t: t)),
        kinetic_energy=(("time",), lambda t: 0.0 * t),
        elastic_energy=(("time",), lambda t: 1.0 * t),
        damping_loss=(("time",), lambda t: 2.0 * t),
    )
    balance = energy_balance(run_of(data).variables)
    assert (balance.energy_potential_J, balance.energy_slip_J, balance.energy_constraints_J) == (None, None, None)
    assert balance.energy_numerical_J == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("duration_s", [0.0, 1.0, 3.0])
def test_a_run_too_short_for_a_gait_tells_none_of_it(duration_s: float) -> None:
    read = gait(run_of(walking(duration_s)))
    assert read == Gait()


def test_numbers_are_none_and_never_nan() -> None:
    data = walking().drop_vars(["muscle_force", "ring_length"])
    data.attrs.clear()
    read = gait(run_of(data))
    assert read.speed_m_per_s == pytest.approx(0.01)
    for field in (
        "speed_body_lengths_per_s",
        "slip_ratio",
        "cost_of_transport",
        "cost_of_transport_net",
        "cost_of_transport_cables",
    ):
        assert getattr(read, field) is None
    json.dumps(summary(run_of(data)).to_dict(), allow_nan=False)
