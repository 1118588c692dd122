"""The controller around the peristalsis network: order of a step, activation, state, records."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.config.settings import StretchSensor as SensorSection
from annelid.control import SnsController
from annelid.control.sns import Sns
from annelid.errors import ConfigError
from annelid.nervous import neuron_names
from annelid.protocols import Sensation, StridingController

REST_M = 0.07


def controller(n_segments=3, n_muscles=None, timestep_s=0.001, sensor=None, **fields) -> SnsController:
    return SnsController(
        Sns(**fields),
        sensor or SensorSection(startup_hold_s=0.0),
        n_segments,
        n_muscles or n_segments,
        timestep_s,
    )


def sensation(time_s: float, excess_m) -> Sensation:
    excess = np.asarray(excess_m, dtype=float)[:, np.newaxis]
    n = excess.shape[0]
    return Sensation(
        time_s, REST_M + excess, np.full((n, 1), REST_M), np.zeros(n), np.zeros(n), np.zeros((n, 3)), np.zeros(3)
    )


OFF = 0.02


def potential(one: SnsController) -> dict[str, float]:
    return dict(zip(neuron_names(3), np.asarray(one.read(frame=False)["potential"]), strict=True))


def test_the_kick_acts_on_the_first_contraction_neuron_in_the_first_step_only():
    kicked, still = controller(kick_nA=1.0), controller(kick_nA=0.0)
    for step in range(2):
        for one in (kicked, still):
            one.step(sensation(step * 1e-3, [OFF] * 3))
        if step == 0:
            a, b = potential(kicked), potential(still)
            assert a.pop("contraction_1") - b.pop("contraction_1") == pytest.approx(1.0 / 5.0, abs=1e-12)
            assert a == b
            still.set_state({**still.get_state(), "potential": kicked.get_state()["potential"]})
    assert potential(kicked) == potential(still)


def test_what_is_sensed_at_the_beginning_acts_during_the_step():
    one, dark = controller(), controller()
    one.step(sensation(0.0, [OFF, 0.0, OFF]))
    dark.step(sensation(0.0, [OFF, OFF, OFF]))
    a, b = potential(one), potential(dark)
    assert a.pop("sensory_2") - b.pop("sensory_2") == pytest.approx(20.0 / 5.0, abs=1e-12)
    assert a == b
    assert np.asarray(one.read(frame=False)["sensor_on"]).tolist() == [0.0, 1.0, 0.0]


@given(slope=st.floats(0.01, 1.0), steps=st.integers(1, 5), seed=st.integers(0, 99))
def test_sigmoid_activation_rises_with_contraction(slope, steps, seed):
    rng = np.random.default_rng(seed)
    one = controller(activation="sigmoid", activation_slope_per_mV=slope)
    activation = np.empty(3)
    for step in range(steps):
        activation = one.step(sensation(step * 1e-3, rng.uniform(-OFF, OFF, 3)))
    u = potential(one)
    for s in (1, 2, 3):
        difference = u[f"contraction_{s}"] - u[f"expansion_{s}"]
        assert activation[s - 1] == pytest.approx(1 / (1 + np.exp(-slope * difference)), rel=1e-12)
    # The network starts with segment 1 contracted and the others expanded.
    assert activation[0] > 0.5 > activation[1:].max()


def test_linear_activation_is_the_planar_worms_clipped_difference():
    one = controller(activation="linear")
    seen = []
    for step in range(900):
        activation = one.step(sensation(step * 1e-3, [OFF, 0.0 if step > 200 else OFF, 0.0]))
        u = potential(one)
        clipped = [max(-20.0, min(20.0, u[f"contraction_{s}"] - u[f"expansion_{s}"])) for s in (1, 2, 3)]
        assert activation == pytest.approx(0.5 + np.array(clipped) / 40.0, abs=1e-12)
        seen.append(activation)
    assert np.min(seen) == 0.0
    assert np.max(seen) == 1.0


def test_both_halves_of_a_ring_get_the_same():
    whole, halves = controller(), controller(n_muscles=6)
    a = whole.step(sensation(0.0, [OFF, 0.0, OFF]))
    b = halves.step(sensation(0.0, [OFF, 0.0, OFF]))
    assert a.shape == (3,)
    assert b.tolist() == [a[0], a[0], a[1], a[1], a[2], a[2]]


@pytest.mark.parametrize("scheme", ["euler", "toolbox", "heun"])
def test_restored_controller_continues_bit_for_bit(scheme):
    sensor = SensorSection(hysteresis_m=0.003, startup_hold_s=0.02)
    rng = np.random.default_rng(0)
    felt = [sensation(i * 1e-3, rng.uniform(0, OFF, 3)) for i in range(400)]
    one = controller(sensor=sensor, scheme=scheme)
    for s in felt[:150]:
        one.step(s)
    state = one.get_state()
    rest = [one.step(s) for s in felt[150:]]

    other = controller(sensor=sensor, scheme=scheme)
    other.set_state(state)
    assert all(np.array_equal(a, other.step(s)) for a, s in zip(rest, felt[150:], strict=True))
    # The saved arrays are copies, and reset is a true beginning.
    again = one.get_state()
    assert {k: (v.shape, v.dtype) for k, v in again.items()} == {k: (v.shape, v.dtype) for k, v in state.items()}
    one.reset(5)
    fresh = controller(sensor=sensor, scheme=scheme)
    assert all(np.array_equal(one.step(s), fresh.step(s)) for s in felt[:150])


def sensor_2(one: SnsController) -> float:
    return np.asarray(one.read(frame=False)["sensor_on"])[1]


def test_a_sensor_held_on_by_hysteresis_is_part_of_the_state():
    sensor = SensorSection(tolerance_m=0.010, hysteresis_m=0.003, startup_hold_s=0.0)
    near, between = sensation(0.0, [OFF, 0.0, OFF]), sensation(0.001, [OFF, 0.012, OFF])
    one, restored = controller(sensor=sensor), controller(sensor=sensor)
    one.step(near)
    state = one.get_state()
    one.reset(0)
    one.step(between)
    assert sensor_2(one) == 0.0
    restored.set_state(state)
    restored.step(between)
    assert sensor_2(restored) == 1.0


def test_recordable_names_what_read_returns():
    one = controller(n_segments=4)
    one.step(sensation(0.0, [OFF] * 4))
    recordable, values = one.recordable(), one.read(frame=False)
    assert {s.name: s.shape for s in recordable.signals} == {k: np.shape(v) for k, v in values.items()}
    assert list(recordable.coords["neuron"]) == neuron_names(4)
    assert recordable.attrs["conductance_sodium_uS"] == pytest.approx(1.048507, abs=5e-7)
    assert one.read(frame=True) == {}


def test_sodium_gates_are_recorded_where_there_are_any():
    one = controller(gate_start="steady")
    gate = np.asarray(one.read(frame=False)["sodium_gate"]).reshape(3, 4)
    assert np.isnan(gate[:, 2:]).all()
    u = np.asarray(one.read(frame=False)["potential"]).reshape(3, 4)[:, :2]
    np.testing.assert_allclose(gate[:, :2], 1 / (1 + 0.5 * np.exp(0.05 * u)), rtol=1e-12)
    turned = controller(gate_start="toolbox")
    gate = np.asarray(turned.read(frame=False)["sodium_gate"]).reshape(3, 4)
    np.testing.assert_allclose(gate[:, :2], 1 / (1 + 0.5 * np.exp(-0.05 * u)), rtol=1e-12)


def test_alarm_rings_when_the_step_is_too_long_and_only_then():
    good, bad = controller(), controller(timestep_s=0.05)
    for step in range(200):
        good.step(sensation(step * 1e-3, [OFF, 0.0, 0.0]))
        assert good.alarm() is None
        if bad.alarm() is None:
            bad.step(sensation(step * 0.05, [OFF, 0.0, 0.0]))
    message = bad.alarm()
    assert message is not None
    assert "control timestep of 50 ms is too long" in message


@pytest.mark.parametrize(("n_segments", "n_muscles"), [(3, 4), (3, 9), (2, 2)])
def test_worms_that_do_not_fit_are_refused(n_segments, n_muscles):
    with pytest.raises(ConfigError, match=r"n_(muscles|segments)"):
        controller(n_segments=n_segments, n_muscles=n_muscles)


def same_state(one: SnsController, other: SnsController) -> None:
    for a, b in zip(one.get_state().values(), other.get_state().values(), strict=True):
        np.testing.assert_array_equal(a, b)


chunk_sizes = st.lists(st.integers(1, 30), min_size=1, max_size=8)


@settings(max_examples=50)
@given(
    chunks=chunk_sizes,
    hold_s=st.floats(0.0, 0.08),
    tolerance_m=st.floats(0.0, 0.02),
    hysteresis_m=st.floats(0.0, 0.01),
    timestep_s=st.sampled_from([0.001, 0.0005, 0.0007]),
    scheme=st.sampled_from(["euler", "toolbox", "heun"]),
    seed=st.integers(0, 999),
    is_carried_on=st.booleans(),
)
def test_a_stride_is_bitwise_so_many_steps(
    chunks, hold_s, tolerance_m, hysteresis_m, timestep_s, scheme, seed, is_carried_on
):
    section = SensorSection(tolerance_m=tolerance_m, hysteresis_m=hysteresis_m, startup_hold_s=hold_s)
    one, other = (controller(timestep_s=timestep_s, sensor=section, scheme=scheme, kick_nA=2.0) for _ in range(2))
    assert isinstance(one, StridingController)
    rng = np.random.default_rng(seed)
    taken = 0
    for n_steps in chunks:
        excess = rng.uniform(-0.01, 0.03, 3)
        felt = replace(
            sensation(taken * timestep_s, excess), stretch_rate_m_per_s=rng.uniform(-0.5, 0.5, (3, 1)) * is_carried_on
        )
        stepped = [other.step(felt.later(step * timestep_s)) for step in range(taken, taken + n_steps)]
        np.testing.assert_array_equal(one.stride(felt, n_steps), stepped)
        same_state(one, other)
        taken += n_steps


@settings(max_examples=50)
@given(
    n_steps=st.integers(1, 60),
    n_copies=st.integers(1, 9),
    hysteresis_m=st.sampled_from([0.0, 0.005]),
    hold_s=st.sampled_from([0.0, 0.02, 0.2]),
    seed=st.integers(0, 999),
)
def test_copies_are_bitwise_single_controllers(n_steps, n_copies, hysteresis_m, hold_s, seed):
    rng = np.random.default_rng(seed)
    section = SensorSection(hysteresis_m=hysteresis_m, startup_hold_s=hold_s)
    singles = [controller(sensor=section, kick_nA=2.0) for _ in range(n_copies)]
    first = [one.get_state() for one in singles]
    states = {name: np.stack([state[name] for state in first]) for name in first[0]} | {"n_steps": np.array(0)}
    for taken in range(n_steps):
        alike = [sensation(taken * 0.001, rng.uniform(-0.01, 0.03, 3)) for _ in singles]
        together = replace(alike[0], stretch_m=np.stack([felt.stretch_m for felt in alike]))
        states, activation = controller(sensor=section, kick_nA=2.0).step_copies(states, together)
        assert int(states["n_steps"]) == taken + 1
        for copy, (one, felt) in enumerate(zip(singles, alike, strict=True)):
            np.testing.assert_array_equal(activation[copy], one.step(felt))
            alone = one.get_state()
            for name in ("potential", "gate", "sensor_on"):
                np.testing.assert_array_equal(states[name][copy], alone[name])
