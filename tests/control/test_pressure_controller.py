"""The peristalsis network with pressure feedback: what each of its synapses does, and nothing else."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from annelid.config import StretchSensor, load_config
from annelid.control import SnsController
from annelid.control.pressure import PressureController, PressureSns
from annelid.errors import ConfigError
from annelid.nervous.peristalsis import pressure_network
from annelid.protocols import SIDES, Array, Sensation

N = 4
SENSOR = StretchSensor(tolerance_m=0.005, startup_hold_s=0.0)


ALONE: dict[str, Any] = {
    "hold": 0.0,
    "release": 0.0,
    "exchange": 0.0,
    "light_N": 1.0,
    "full_N": 6.0,
    "pressure_time_constant_s": 0.005,
}
"""No synapse of ours, and quick neurons."""


def controller(**changes: Any) -> PressureController:
    return PressureController(PressureSns(**changes), SENSOR, N, N, 0.001)


def felt(load_N: Array, longer_m: Array, time_s: float = 1.0) -> Sensation:
    rest = np.full((N, 6), 0.07)
    touch = np.zeros((N, len(SIDES)))
    touch[:, 0], touch[:, 2] = 0.75 * load_N, 0.25 * load_N
    return Sensation(
        time_s=time_s,
        stretch_m=rest + longer_m[:, None],
        rest_stretch_m=rest,
        ring_length_m=np.ones(N),
        muscle_force_N=np.zeros(N),
        contact_force_N=np.zeros((N, 3)),
        center_of_mass_m=np.zeros(3),
        touch_N=touch,
    )


def sensory(driven: PressureController, load_N: Array, longer_m: Array, seconds: float = 0.5) -> Array:
    """Potentials of the sensory neurons once they have settled under the same feelings, mV."""
    driven.reset(0)
    for i in range(round(seconds / 0.001)):
        driven.step(felt(load_N, longer_m, 1.0 + 0.001 * i))
    names = [str(name) for name in driven.recordable().coords["neuron"]]
    potential = np.asarray(driven.read(False)["potential"])
    return potential[[names.index(f"sensory_{segment}") for segment in range(1, N + 1)]]


@pytest.mark.parametrize(("load", "share"), [(1.0, 0.0), (3.5, 0.5), (20.0, 1.0)])
def test_a_stretched_segment_holds_only_as_far_as_it_bears_load(load: float, share: float) -> None:
    """Segment 2, while segment 1 is contracted and so sends no relay; the synapse is exact at no and full pressure."""
    hold = 0.4
    driven = controller(**(ALONE | {"hold": hold}))
    reached = sensory(driven, np.array([0.0, load, 0.0, 0.0]), np.full(N, 0.02), 0.04)
    assert reached[1] == pytest.approx(share * hold * 20.0, abs=0.3)


@pytest.mark.parametrize("exchange", [0.5, 0.9])
def test_a_contracting_segment_ends_the_contraction_two_segments_before(exchange: float) -> None:
    """Segment 1 contracts at the start; segment 2, at rest length, sends no relay to segment 3, two before it."""
    lengths = np.array([0.02, 0.0, 0.02, 0.02])
    reached = sensory(controller(**(ALONE | {"exchange": exchange})), np.zeros(N), lengths, 0.04)
    without = sensory(controller(**ALONE), np.zeros(N), lengths, 0.04)
    assert reached[2] == pytest.approx(exchange * 20.0, abs=0.3)
    assert without[2] == pytest.approx(0.0, abs=0.3)


def test_an_extended_segment_lets_the_next_one_go_loaded_or_not() -> None:
    longer = np.array([0.0, 0.08, 0.0, 0.0])
    for load in (np.zeros(N), np.full(N, 6.0)):
        reached = sensory(controller(), load, longer)
        assert reached[2] <= 0.0, "segment 3 follows segment 2"
        assert np.all(reached[[0, 3]] > 19.0)


def test_the_last_segment_lets_the_first_one_go() -> None:
    reached = sensory(controller(), np.full(N, 6.0), np.array([0.0, 0.0, 0.0, 0.08]))
    assert reached[0] <= 0.0


def test_without_conductances_it_is_the_paper_s_network_to_the_last_bit() -> None:
    section = PressureSns(hold=0.0, release=0.0, exchange=0.0)
    ours, papers = (
        PressureController(section, SENSOR, N, N, 0.001),
        SnsController(section.network, SENSOR, N, N, 0.001),
    )
    random = np.random.default_rng(3)
    for i in range(2000):
        feeling = felt(random.uniform(0, 8, N), random.uniform(-0.01, 0.08, N), 0.001 * i)
        assert np.array_equal(ours.step(feeling), papers.step(feeling))


def test_every_segment_ends_the_contraction_two_before_where_that_is_not_the_next_one(
    subtests: pytest.Subtests,
) -> None:
    for n_segments, expected in ((3, 0), (4, 4), (6, 6)):
        with subtests.test(f"{n_segments!r:.60}"):
            links = [
                (int(one.source.split("_")[1]), int(one.target.split("_")[1]))
                for one in pressure_network(n_segments).connections
                if one.source.startswith("contraction") and one.target.startswith("sensory")
            ]
            assert len(links) == expected
            assert all((source - target) % n_segments == 2 for source, target in links)


@pytest.mark.parametrize("start_s", [0.0, 0.195, 3.0])
def test_a_stride_is_so_many_steps(start_s: float) -> None:
    sensor = StretchSensor(tolerance_m=0.005, startup_hold_s=0.2)
    steps, strides = (PressureController(PressureSns(), sensor, N, N, 0.001) for _ in range(2))
    feeling = felt(np.array([6.0, 3.0, 0.0, 2.0]), np.array([0.06, 0.0, 0.07, 0.01]), start_s)
    single = [steps.step(replace(feeling, time_s=round(start_s + 0.001 * i, 9))) for i in range(10)]
    assert np.array_equal(strides.stride(feeling, 10), single)
    for name, value in steps.get_state().items():
        assert np.array_equal(value, strides.get_state()[name]), name


def test_the_first_segment_is_not_held_by_its_load_at_the_start() -> None:
    """Its first contraction is the paper's; without the hold at the start its own load ends it."""
    lengths = []
    for startup_hold_s in (0.2, 0.0):
        sensor = StretchSensor(tolerance_m=0.005, startup_hold_s=startup_hold_s)
        ours = PressureController(PressureSns(), sensor, N, N, 0.001)
        papers = SnsController(PressureSns().network, StretchSensor(startup_hold_s=0.2), N, N, 0.001)
        counts = [0, 0]
        for i in range(190):
            feeling = felt(np.full(N, 6.0), np.array([0.02, 0.0, 0.0, 0.0]), 0.001 * i)
            for k, driven in enumerate((ours, papers)):
                counts[k] += driven.step(feeling)[0] > 0.5
        lengths.append(counts)
    (held, plain), (loaded, _) = lengths
    assert held == plain > 50
    assert loaded < held


def test_scales_that_do_not_rise_are_refused(subtests: pytest.Subtests) -> None:
    for changes, words in (
        ({"controller.light_N": 9.0}, "controller.light_N = 9 must be less than controller.full_N = 9"),
        ({"controller.extended_m": 0.04}, "controller.extending_m = 0.045 must be less than"),
        ({"controller.hold": -1.0}, "hold = -1.0: must be at least 0"),
        ({"controller.exchange": 6.0}, "exchange = 6.0: must be at most 5"),
    ):
        with subtests.test(f"{changes!r:.60}"), pytest.raises(ConfigError, match=words):
            load_config({"controller": {"kind": "sns-pressure"}}, changes)


def test_a_body_without_skin_is_refused() -> None:
    with pytest.raises(ConfigError, match="needs the touch of a skin"):
        load_config("riddle2022-planar", {"controller": {"kind": "sns-pressure"}})


def test_parameters_of_the_wrong_sign_are_refused() -> None:
    with pytest.raises(ConfigError, match="hold must be at least 0, not -1"):
        pressure_network(3, hold=-1.0)
    with pytest.raises(ConfigError, match="pressure_time_constant_s"):
        PressureController(PressureSns(pressure_time_constant_s=0.001), SENSOR, N, N, 0.002)
