"""What controllers of a network share: the design of its section, and activation from the right neurons."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from annelid.config.settings import StretchSensor as SensorSection
from annelid.control import AdaptiveController, SnsController
from annelid.control.base import design_of
from annelid.control.pressure import PressureController, PressureSns
from annelid.control.robust import RobustController, RobustSns
from annelid.control.sns import AdaptiveSns, Sns
from annelid.control.turning import ConstantTurning, TurningController
from annelid.control.waiting import WaitingController, WaitingSns
from annelid.nervous import PeristalsisParameters
from annelid.nervous.robust import RobustParameters
from annelid.protocols import SIDES, Sensation

Neural = SnsController | AdaptiveController | RobustController

N = 4
SLOPE_PER_MV, RANGE_MV = 0.1, 15.0


def built(kind: str, n_muscles: int = N, **changes: Any) -> Neural:
    size, sensor = (N, n_muscles, 0.001), SensorSection()
    changes |= {"activation_slope_per_mV": SLOPE_PER_MV, "range_mV": RANGE_MV}
    match kind:
        case "sns":
            return SnsController(Sns(**changes), sensor, *size)
        case "adaptive":
            section = AdaptiveSns(network=Sns(**changes))
            return AdaptiveController(section, sensor, *size)
        case _:
            return RobustController(RobustSns(**changes), *size)


def gives(controller: Neural, **potential_mV: list[float]) -> np.ndarray:
    """Activation at potentials of the named roles; every other neuron is at 7 mV."""
    names = list(controller.recordable().coords["neuron"])
    potential = np.full(len(names), 7.0)
    for role, values in potential_mV.items():
        for segment, value in enumerate(values, start=1):
            potential[names.index(f"{role}_{segment}")] = value
    return controller._activation(potential)


@pytest.mark.parametrize("n_muscles", [N, 2 * N])
@pytest.mark.parametrize("kind", ["sns", "adaptive", "sns-robust"])
def test_activation_is_the_sigmoid_of_each_segments_half_centre(kind: str, n_muscles: int) -> None:
    contraction, expansion = [20.0, -3.0, 0.5, 11.0], [1.0, 18.0, 0.5, -40.0]
    found = gives(built(kind, n_muscles), contraction=contraction, expansion=expansion)
    expected = 1.0 / (1.0 + np.exp(-SLOPE_PER_MV * (np.array(contraction) - expansion)))
    assert found == pytest.approx(expected.repeat(n_muscles // N), rel=1e-12)


@pytest.mark.parametrize("kind", ["sns", "adaptive"])
def test_linear_activation_is_clipped_at_the_range(kind: str) -> None:
    controller = built(kind, activation="linear")
    found = gives(controller, contraction=[15.0, 7.5, 0.0, -40.0], expansion=[0.0, 0.0, 7.5, 20.0])
    assert found == pytest.approx([1.0, 0.75, 0.25, 0.0], abs=1e-12)


@pytest.mark.parametrize(
    ("kind", "section"),
    [
        (PeristalsisParameters, Sns(range_mV=17.0, gate_time_constant_ms=120.0)),
        (RobustParameters, RobustSns(range_mV=17.0, turn_ms=500.0, bifurcation_mV=-2.0)),
    ],
)
def test_a_design_has_every_parameter_of_its_section(kind: Any, section: Any) -> None:
    design = design_of(kind, section)
    default = kind()
    changed = {name for name in vars(default) if getattr(design, name) != getattr(default, name)}
    assert changed == set(section.model_fields_set)
    assert all(getattr(design, name) == getattr(section, name) for name in changed)


@pytest.mark.parametrize("slope_per_s", [0.0, 3.0])
def test_a_stride_under_a_drive_is_its_steps_bit_for_bit(slope_per_s: float) -> None:
    section = AdaptiveSns(drive=0.3, drive_slope_per_s=slope_per_s, stretch_gain_per_m=5.0)
    sensor = SensorSection(startup_hold_s=0.013)
    walked, strode = (AdaptiveController(section, sensor, N, N, 0.001) for _ in range(2))
    rest, zeros = np.full((N, 2), 0.1), np.zeros(N)
    for first in range(0, 60, 10):
        extra = 0.002 * np.arange(first, first + N, dtype=np.float64) % 0.03
        longer = np.asarray(rest + extra[:, np.newaxis], dtype=np.float64)
        felt = Sensation(first * 0.001, longer, rest, zeros, zeros, np.zeros((N, 3)), np.zeros(3))
        stepped = [walked.step(replace(felt, time_s=(first + k) * 0.001)) for k in range(10)]
        assert np.array_equal(strode.stride(felt, 10), stepped)
    assert all(np.array_equal(walked.get_state()[name], value) for name, value in strode.get_state().items())
    assert np.asarray(walked.read(frame=False)["drive"], dtype=np.float64) > 0.0


HELD = SensorSection(startup_hold_s=0.013, hysteresis_m=0.004)


STRIDING: dict[str, Callable[[], Any]] = {
    "sns": lambda: SnsController(Sns(), HELD, N, N, 0.001),
    "adaptive": lambda: AdaptiveController(AdaptiveSns(drive=0.3, stretch_gain_per_m=5.0), HELD, N, N, 0.001),
    "sns-pressure": lambda: PressureController(PressureSns(), HELD, N, N, 0.001),
    "sns-waiting": lambda: WaitingController(WaitingSns(), HELD, N, N, 0.001),
    "sns-robust": lambda: RobustController(RobustSns(), N, N, 0.001),
    "turned": lambda: TurningController(
        SnsController(Sns(), HELD, N, 2 * N, 0.001), ConstantTurning(modulation=0.5), N, 2 * N, 0.001
    ),
}


@pytest.mark.parametrize("make", STRIDING.values(), ids=STRIDING)
def test_within_a_stride_lengths_go_on_at_their_rates(make: Callable[[], Any]) -> None:
    walked, strode, unmoved = make(), make(), make()
    rng, rest, zeros = np.random.default_rng(4), np.full((N, 3), 0.1), np.zeros(N)
    moved_by_mV = 0.0
    for first in range(0, 200, 10):
        lengths, rates = rest + rng.uniform(0.0, 0.06, (N, 3)), rng.uniform(-4.0, 4.0, (N, 3))
        felt = Sensation(
            first * 0.001, lengths, rest, zeros, zeros, np.zeros((N, 3)), np.zeros(3),
            touch_N=np.zeros((N, len(SIDES))), stretch_rate_m_per_s=rates,
        )  # fmt: skip
        stepped = [walked.step(felt.later((first + k) * 0.001)) for k in range(10)]
        # A mean of lengths carried on, and a length carried on by a mean of rates, differ by rounding.
        np.testing.assert_allclose(strode.stride(felt, 10), stepped, rtol=1e-9, atol=1e-12)
        unmoved.stride(replace(felt, stretch_rate_m_per_s=np.zeros((0, 0))), 10)
        by_steps, by_stride, without = (one.read(frame=False)["potential"] for one in (walked, strode, unmoved))
        np.testing.assert_allclose(by_stride, by_steps, rtol=1e-9, atol=1e-9)
        moved_by_mV = max(moved_by_mV, float(np.abs(by_stride - without).max()))
    assert moved_by_mV > 0.1, "the rates are of consequence"
