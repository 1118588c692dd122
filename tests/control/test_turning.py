"""Turning as a modifier of any pattern: scales, descending neurons, steering, the published rule of touch, refusals."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from circuits import controller
from hypothesis import given
from hypothesis import strategies as st

from annelid.config import check_config, load_config
from annelid.control import CircuitController, OpenLoopController
from annelid.control.open_loop import TimedWave
from annelid.control.turning import (
    ConstantTurning,
    CourseTurning,
    HeadingTurning,
    Steering,
    TouchTurning,
    TurningController,
    TurningKind,
    half_scales,
    heading_angle,
    wrapped,
)
from annelid.errors import ConfigError
from annelid.protocols import SIDES, Controller, Sensation

N = 3
STEP_S = 0.001
REST_M = 0.07


def felt(
    time_s: float = 0.0,
    *,
    heading_deg: float = 0.0,
    front_m: tuple[float, float] = (0.0, 0.0),
    left_N: float = 0.0,
    right_N: float = 0.0,
    longer_m: float = 0.0,
    n_segments: int = N,
) -> Sensation:
    """What a worm feels whose heading is that far to the left of -x."""
    angle = np.radians(heading_deg)
    touch = np.zeros((n_segments, len(SIDES)))
    touch[0, SIDES.index("left")], touch[0, SIDES.index("right")] = left_N, right_N
    rest = np.full((n_segments, 2), REST_M)
    return Sensation(
        time_s,
        rest + longer_m,
        rest,
        np.zeros(2 * n_segments),
        np.zeros(2 * n_segments),
        np.zeros((n_segments, 3)),
        np.zeros(3),
        touch_N=touch,
        front_m=np.array([*front_m, 0.1]),
        heading=np.array([-np.cos(angle), -np.sin(angle), 0.0]),
    )


def turned(section: TurningKind, pattern: Controller | None = None, n_segments: int = N) -> TurningController:
    return TurningController(pattern or wave(n_segments), section, n_segments, 2 * n_segments, STEP_S)


def wave(n_segments: int = N) -> OpenLoopController:
    return OpenLoopController(TimedWave(rise_s=0.1, hold_s=0.1, fall_s=0.1, interval_s=0.1), n_segments, 2 * n_segments)


def sns(n_segments: int = N) -> CircuitController:
    return controller(n_segments=n_segments, n_muscles=2 * n_segments)


SECTIONS: list[TurningKind] = [
    ConstantTurning(modulation=0.7),
    HeadingTurning(heading_deg=30.0),
    CourseTurning(waypoints=((-1.0, 0.5), (-2.0, 0.0))),
    TouchTurning(),
]


def journey(n_steps: int) -> list[Sensation]:
    """A worm that turns, moves on and touches things."""
    random = np.random.default_rng(3)
    return [
        felt(
            k * STEP_S,
            heading_deg=float(200.0 * k / n_steps),
            front_m=(-2.5 * k / n_steps, 0.5 * k / n_steps),
            left_N=float(random.uniform(0.0, 9.0)),
            right_N=float(random.uniform(0.0, 9.0)),
            longer_m=0.03 * (k > n_steps // 2),
        )
        for k in range(n_steps)
    ]


@pytest.mark.parametrize("section", SECTIONS, ids=lambda section: section.kind)
class TestEveryKind:
    @pytest.mark.parametrize("pattern", [wave, sns])
    def test_a_stride_is_so_many_steps_bit_for_bit(self, section: TurningKind, pattern: Any) -> None:
        stepped_on, strided = turned(section, pattern()), turned(section, pattern())
        for first in range(0, 400, 10):
            here = journey(400)[first]
            stepped = [stepped_on.step(replace(here, time_s=(first + later) * STEP_S)) for later in range(10)]
            assert np.array_equal(stepped, strided.stride(here, 10))
        before, after = stepped_on.get_state(), strided.get_state()
        assert before.keys() == after.keys()
        assert all(np.array_equal(before[name], after[name], equal_nan=True) for name in before)

    def test_goes_on_from_a_saved_state_bit_for_bit(self, section: TurningKind) -> None:
        one, other = turned(section, sns()), turned(section, sns())
        way = journey(300)
        for here in way[:150]:
            one.step(here)
        other.set_state(one.get_state())
        for here in way[150:]:
            assert np.array_equal(one.step(here), other.step(here))
        one.reset(0)
        fresh = turned(section, sns())
        assert all(np.array_equal(one.step(here), fresh.step(here)) for here in way[:100])

    def test_a_mirrored_journey_mirrors_the_activation(self, section: TurningKind) -> None:
        mirrored = mirror_of(section)
        one, other = turned(section), turned(mirrored)
        for here in journey(500):
            a, b = one.step(here), other.step(mirrored_feeling(here))
            assert np.allclose(a.reshape(-1, 2), b.reshape(-1, 2)[:, ::-1], rtol=0.0, atol=1e-12)

    def test_names_what_it_reads(self, section: TurningKind) -> None:
        one = turned(section, sns())
        one.step(felt())
        named, values = one.recordable(), one.read(frame=False)
        assert {signal.name for signal in named.signals} == set(values)
        for signal in named.signals:
            assert np.shape(values[signal.name]) == signal.shape
        assert named.attrs["turning"] == section.kind
        assert named.coords["half"] == ["left", "right"]


def mirror_of(section: TurningKind) -> TurningKind:
    if isinstance(section, ConstantTurning):
        return section.model_copy(update={"modulation": -section.modulation})
    if isinstance(section, HeadingTurning):
        return section.model_copy(update={"heading_deg": -section.heading_deg})
    if isinstance(section, CourseTurning):
        return section.model_copy(update={"waypoints": tuple((x, -y) for x, y in section.waypoints)})
    return section


def mirrored_feeling(here: Sensation) -> Sensation:
    touch = here.touch_N[:, [SIDES.index(side) for side in ("belly", "right", "back", "left")]]
    over = np.array([1.0, -1.0, 1.0])
    return replace(here, touch_N=touch, front_m=here.front_m * over, heading=here.heading * over)


@given(st.floats(-1.0, 1.0))
def test_a_modulation_takes_from_one_side_only(modulation: float) -> None:
    left, right = half_scales(modulation)
    assert right - left == pytest.approx(modulation)
    assert max(left, right) == 1.0


def test_the_pattern_keeps_its_rhythm_and_one_side_its_size(subtests: pytest.Subtests) -> None:
    for modulation in (-1.0, -0.4, 0.6):
        with subtests.test(f"{modulation!r:.60}"):
            plain, turning = wave(), turned(ConstantTurning(modulation=modulation, descending_time_constant_s=1e-3))
            settled = 50
            for k in range(600):
                whole, scaled = (
                    plain.step(felt(k * STEP_S)).reshape(-1, 2),
                    turning.step(felt(k * STEP_S)).reshape(-1, 2),
                )
                if k >= settled:
                    assert np.allclose(scaled, whole * half_scales(modulation), rtol=1e-12, atol=1e-12)


def test_every_segment_takes_its_share_and_a_negative_one_bends_the_other_way() -> None:
    shares = (1.0, 0.0, -0.5)
    section = ConstantTurning(modulation=0.8, shares=shares, descending_time_constant_s=1e-3)
    scales = Steering(section, N, STEP_S).advance(felt(), 100)
    assert scales.tolist() == [pytest.approx([0.2, 1.0]), [1.0, 1.0], pytest.approx([1.0, 0.6])]
    with pytest.raises(ConfigError, match=r"turning.shares has 3 entries: must have 6, one per segment"):
        load_config("riddle2025", {"turning.shares": list(shares)})


def test_descending_neurons_follow_with_their_time_constant() -> None:
    steering = Steering(ConstantTurning(modulation=1.0, descending_time_constant_s=0.05), 1, STEP_S)
    for k in range(1, 200):
        left, right = steering.advance(felt(), 1)[0]
        assert left == pytest.approx(np.exp(-k * STEP_S / 0.05), rel=1e-9)
        assert right == 1.0


class TestSteering:
    def test_it_turns_towards_the_wanted_heading(self, subtests: pytest.Subtests) -> None:
        for error_deg in (-40.0, -10.0, 10.0, 40.0):
            with subtests.test(f"{error_deg!r:.60}"):
                steering = Steering(HeadingTurning(heading_deg=error_deg, gain_per_rad=1.0), 1, STEP_S)
                left, right = steering.advance(felt(heading_deg=25.0), 20_000)[0]
                assert right - left == pytest.approx(np.radians(error_deg), rel=1e-6)

    def test_it_takes_the_shorter_way_round(self) -> None:
        steering = Steering(HeadingTurning(heading_deg=170.0, gain_per_rad=0.3), 1, STEP_S)
        steering.advance(felt(heading_deg=0.0), 1)
        left, right = steering.advance(felt(heading_deg=-170.0), 50_000)[0]
        assert right - left == pytest.approx(-0.3 * np.radians(20.0), rel=1e-6)

    def test_a_steady_rate_of_turning_is_taken_off(self) -> None:
        rate_deg_per_s, slow = 5.0, 2.0
        section = HeadingTurning(gain_per_rad=0.0, rate_gain_s=2.0, rate_time_constant_s=slow)
        steering = Steering(section, 1, STEP_S)
        scales = np.ones(2)
        for k in range(12_000):
            scales = steering.advance(felt(heading_deg=wrapped_deg(rate_deg_per_s * k * STEP_S + 150.0)), 1)[0]
        assert scales[1] - scales[0] == pytest.approx(-2.0 * np.radians(rate_deg_per_s), rel=0.01)

    def test_the_largest_modulation_is_never_exceeded(self) -> None:
        section = HeadingTurning(heading_deg=90.0, gain_per_rad=50.0, largest_modulation=0.4)
        left, right = Steering(section, 1, STEP_S).advance(felt(), 20_000)[0]
        assert (left, right) == (pytest.approx(0.6), 1.0)

    def test_waypoints_are_taken_in_order_and_left_behind(self) -> None:
        section = CourseTurning(waypoints=((-1.0, -1.0), (-3.0, 1.0)), reach_m=0.2, gain_per_rad=0.5)
        steering = Steering(section, 1, STEP_S)
        towards = []
        for front in ((0.0, 0.0), (-0.95, -0.95), (-2.95, 1.05)):
            left, right = steering.advance(felt(front_m=front), 50_000)[0]
            towards.append(right - left)
        first, second = np.radians(45.0), heading_angle(np.array([-2.05, 1.95, 0.0]))
        assert towards == pytest.approx([0.5 * first, 0.5 * second, 0.0], abs=1e-6)
        assert second < 0.0


def wrapped_deg(angle_deg: float) -> float:
    return float(np.degrees(wrapped(np.radians(angle_deg))))


class TestTouch:
    """The published rule, worked out by hand at steps of 10 ms: rate 0.1 a step."""

    def scales(self, *forces_N: float) -> list[list[float]]:
        steering = Steering(TouchTurning(), 1, 0.01)
        return [
            steering.advance(felt(left_N=max(-f, 0.0), right_N=max(f, 0.0)), 1)[0].round(9).tolist() for f in forces_N
        ]

    def test_two_newtons_do_not_start_it(self) -> None:
        assert self.scales(2.0, -2.0, 1.5) == [[1.0, 1.0]] * 3

    def test_contact_on_the_right_scales_the_left_side_to_its_latched_minimum(self) -> None:
        # 6 N: to (15 - 6)/15 = 0.6; 9 N: to 0.4, which 3 N (0.8) and 0.5 N do not undo.
        left = [scale for scale, _ in self.scales(6.0, 6.0, 6.0, 6.0, 6.0, 9.0, 3.0, 3.0, 0.5)]
        assert left == [0.9, 0.8, 0.7, 0.6, 0.6, 0.5, 0.4, 0.4, 0.4]

    def test_a_running_timer_listens_to_one_newton(self) -> None:
        # 2.1 N starts it; -1.5 N then scales the right side to 0.9, -0.9 N nothing.
        assert self.scales(2.1, -1.5, -1.5)[-1] == pytest.approx([1 - 2.1 / 15, 0.9], abs=1e-9)
        assert self.scales(2.1, -0.9, -0.9)[-1][1] == 1.0

    def test_six_seconds_later_it_goes_straight_again(self) -> None:
        scales = self.scales(9.0, *[0.0] * 620)
        left = [scale for scale, _ in scales]
        # 600 steps from the one that started it; then back at the same rate.
        assert left[599] == 0.4
        assert left[600:607] == pytest.approx([0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.0])

    def test_the_rate_does_not_depend_on_the_step(self) -> None:
        steering = Steering(TouchTurning(), 1, STEP_S)
        assert steering.advance(felt(right_N=15.0), 50)[0, 0] == pytest.approx(0.5)


class TestRefusals:
    def test_whole_rings(self) -> None:
        with pytest.raises(ConfigError, match=r"needs half-rings: 6 muscles, not 3"):
            TurningController(wave(), ConstantTurning(), N, N, STEP_S)

    @pytest.mark.parametrize("preset", ["riddle2023-rods", "riddle2022-planar"])
    def test_a_worm_without_halves(self, preset: str) -> None:
        with pytest.raises(ConfigError, match=r"turning.kind = 'touch' needs a left and a right half"):
            load_config(preset, {"turning.kind": "touch"})

    @pytest.mark.parametrize("kind", ["heading", "touch"])
    def test_a_body_that_does_not_feel_what_is_needed(self, kind: str) -> None:
        section = check_config({"body": {"rings": {"layout": "halves"}}, "turning": {"kind": kind}}).turning
        assert section is not None
        numb = replace(felt(), touch_N=np.zeros((0, len(SIDES))), heading=np.full(3, np.nan))
        with pytest.raises(ConfigError, match="needs a body that"):
            turned(section).step(numb)
