"""The stretch sensor's threshold, hysteresis and start-up hold."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.config.settings import StretchSensor as SensorSection
from annelid.control import StretchSensor
from annelid.control.stretch_sensor import lengthening_m
from annelid.errors import ConfigError

REST_M = np.full((3, 6), 0.07)


def sensor(tolerance_m=0.01, hysteresis_m=0.0, startup_hold_s=0.0, n_segments=3) -> StretchSensor:
    section = SensorSection(tolerance_m=tolerance_m, hysteresis_m=hysteresis_m, startup_hold_s=startup_hold_s)
    return StretchSensor(section, n_segments)


excesses = st.lists(st.lists(st.floats(-0.03, 0.05), min_size=6, max_size=6), min_size=3, max_size=3)


@given(n_worms=st.integers(1, 4), n_sensors=st.integers(1, 40), seed=st.integers(0, 99))
def test_lengthening_is_the_mean_and_the_same_bits_in_any_memory_layout(n_worms, n_sensors, seed):
    rng = np.random.default_rng(seed)
    stretch, rest = rng.uniform(0.01, 0.2, (2, n_worms, 3, n_sensors))
    together = lengthening_m(stretch, rest)
    assert together == pytest.approx(stretch.mean(axis=-1) - rest.mean(axis=-1), abs=1e-14)
    for layout in (np.asfortranarray, np.ascontiguousarray):
        alone = [lengthening_m(layout(stretch[i]), layout(rest[i])) for i in range(n_worms)]
        assert np.array_equal(together, alone)
        assert np.array_equal(together, lengthening_m(layout(stretch), layout(rest)))


@given(excess_m=excesses)
def test_on_while_the_mean_is_within_the_tolerance(excess_m):
    excess = np.array(excess_m)
    mean = excess.mean(axis=1)
    on = sensor().read(REST_M + excess, REST_M, 5.0)
    clear = np.abs(mean - 0.01) > 1e-12
    assert np.array_equal(on[clear], (mean <= 0.01)[clear])


@given(excess_m=excesses, swap=st.permutations(range(6)))
def test_which_spring_is_long_does_not_matter(excess_m, swap):
    stretch = REST_M + np.array(excess_m)
    margin = np.abs((stretch - REST_M).mean(axis=1) - 0.01) > 1e-12
    straight = sensor().read(stretch, REST_M, 5.0)
    assert np.array_equal(straight[margin], sensor().read(stretch[:, swap], REST_M, 5.0)[margin])


def test_each_segment_has_its_own_rest_length():
    rest = np.array([[0.07], [0.08], [0.09]])
    on = sensor().read(np.full((3, 1), 0.085), rest, 1.0)
    assert on.tolist() == [False, True, True]


def sweep(one: StretchSensor, excesses_m) -> list[bool]:
    return [bool(one.read(REST_M + e, REST_M, 1.0)[1]) for e in excesses_m]


def test_hysteresis_keeps_a_sensor_on_and_not_off():
    up_and_down = [0.016, 0.012, 0.008, 0.012, 0.014, 0.016, 0.012, 0.008]
    assert sweep(sensor(hysteresis_m=0.005), up_and_down) == [
        False, False, True, True, True, False, False, True,
    ]  # fmt: skip
    assert sweep(sensor(), up_and_down) == [False, False, True, False, False, False, False, True]


def test_startup_hold_keeps_segment_1_off_until_it_ends():
    one = sensor(startup_hold_s=0.2)
    # 200 steps of 1 ms add up to a little less or more than 0.2 s; the hold is over at either.
    for time_s, first in [(0.0, False), (0.199, False), (0.2 - 1e-12, True), (0.2 + 1e-12, True), (9.0, True)]:
        assert one.read(REST_M, REST_M, time_s).tolist() == [first, True, True]


def test_a_sensor_kept_off_is_off_for_the_hysteresis_too():
    """Within the tolerance while the hold lasts, and beyond it, within the hysteresis, once it is over."""
    longer, times_s = np.array([[0.008], [0.008], [0.012], [0.012]]), [0.198, 0.199, 0.2, 0.201]
    for startup_hold_s, expected in ((0.2, [False] * 4), (0.0, [True] * 4)):
        one = sensor(hysteresis_m=0.005, startup_hold_s=startup_hold_s, n_segments=1)
        assert one.readings(one.on, longer, times_s)[:, 0].tolist() == expected


@given(
    n_times=st.integers(1, 12), n_held=st.integers(0, 12), hysteresis_m=st.sampled_from([0.0, 0.005]), data=st.data()
)
def test_readings_at_many_instants_are_those_of_one_after_another(n_times, n_held, hysteresis_m, data):
    # On both sides of the tolerance and of the hysteresis.
    lengths = st.lists(st.sampled_from([0.008, 0.012, 0.016]), min_size=3, max_size=3)
    longer = np.array(data.draw(st.lists(lengths, min_size=n_times, max_size=n_times)))
    times_s = [0.001 * k for k in range(n_times)]
    one = sensor(hysteresis_m=hysteresis_m, startup_hold_s=0.001 * n_held)
    together = one.readings(one.on, longer, times_s)
    alone = [
        one.read((REST_M[:, :1] + each[:, np.newaxis]), REST_M[:, :1], t)
        for each, t in zip(longer, times_s, strict=True)
    ]
    assert np.array_equal(together, alone)


def test_reset_forgets():
    one = sensor(hysteresis_m=0.005)
    assert sweep(one, [0.008, 0.012]) == [True, True]
    one.reset()
    assert not one.on.any()
    assert sweep(one, [0.012]) == [False]


def test_the_reading_is_the_callers_to_keep():
    one = sensor()
    reading = one.read(REST_M, REST_M, 1.0)
    reading[:] = False
    assert one.on.all()


def test_no_segments_are_refused():
    with pytest.raises(ConfigError, match="n_segments"):
        sensor(n_segments=0)


@given(
    n_worms=st.integers(1, 6),
    n_sensors=st.integers(1, 20),
    time_s=st.sampled_from([0.0, 0.1, 0.2, 5.0]),
    axes=st.permutations(range(3)),
    seed=st.integers(0, 999),
)
def test_copies_are_read_as_alone(n_worms, n_sensors, time_s, axes, seed):
    rng = np.random.default_rng(seed)
    rest = rng.uniform(0.06, 0.08, (3, n_sensors))
    tolerance, hysteresis = rng.uniform(0, 0.02), rng.uniform(0, 0.01)
    before = rng.random((n_worms, 3)) < 0.5
    shape = np.array([n_worms, 3, n_sensors])
    # Some memory layout: the bits of a mean must not depend on it.
    lengths = np.empty(shape[list(axes)]).transpose(np.argsort(axes))
    lengths[...] = rest + rng.uniform(-0.01, 0.03, shape)
    longer = lengthening_m(lengths, rest)[np.newaxis]
    (together,) = sensor(tolerance, hysteresis, startup_hold_s=0.2).readings(before, longer, [time_s])
    for worm in range(n_worms):
        alone = sensor(tolerance, hysteresis, startup_hold_s=0.2)
        alone.on[:] = before[worm]
        stretch = np.array(lengths[worm], order="C")
        assert np.array_equal(together[worm], alone.read(stretch, rest, time_s))
        # A worm that sits right on its threshold finds any other order of the sum.
        assert np.array_equal(longer[0, worm], (stretch - rest).sum(axis=-1) / n_sensors)
