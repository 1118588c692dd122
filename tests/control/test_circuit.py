"""Circuits: the currents of their inputs, the order of a step, activation, state and records."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from circuits import controller, felt, potential
from hypothesis import given
from hypothesis import strategies as st

from annelid.control import Circuit, CircuitController, Pulse, Readout, Sense, Switch, lengthening_m
from annelid.errors import ConfigError
from annelid.nervous import Network, Neuron, neuron_names
from annelid.protocols import SIDES, Array

OFF = 0.02
SLOPE_PER_MV, RANGE_MV = 0.1, 15.0


def inputs_of(sources: dict[str, Any], n_segments: int = 3, timestep_s: float = 0.001) -> CircuitController:
    """A circuit of neurons without leak and of 1 nF, whose potentials add up the currents of their inputs."""
    network = Network()
    for name in sources:
        network.add_neuron(name, Neuron(capacitance_nF=1e3 * timestep_s, leak_conductance_uS=0.0))
        network.add_input(name, name)
    first = next(iter(sources))
    network.add_output("out", first)
    return CircuitController(Circuit(network, sources, Readout(["out"] * n_segments)), n_segments, timestep_s)


def currents(one: CircuitController, *steps: Any) -> list[list[float]]:
    """The inputs' currents at steps, nA, each given by its sensation."""
    before, found = one.potential_mV.copy(), []
    for sensation in steps:
        one.step(sensation)
        found.append((one.potential_mV - before).round(9).tolist())
        before = one.potential_mV.copy()
    return found


@given(
    value=st.floats(-0.1, 0.1),
    low=st.floats(-0.05, 0.05),
    span=st.floats(0.01, 0.1),
    gain=st.floats(-50.0, 50.0),
    bounds=st.tuples(st.floats(-20.0, 0.0), st.floats(0.0, 20.0)),
)
def test_a_sense_rises_linearly_within_its_bounds(value, low, span, gain, bounds):
    one = inputs_of({"a": Sense("lengthening_m", 1, gain, low, span, *bounds), "b": 2.5})
    [[found, constant]] = currents(one, felt([9.0, value, 9.0]))
    assert found == pytest.approx(np.clip(gain * (value - low) / span, *bounds), abs=1e-8)
    assert constant == 2.5


def test_touch_without_a_side_is_the_load_of_a_segment():
    touch = np.arange(12.0).reshape(3, 4)
    sources = {
        "load": Sense("touch_N", 1, 1.0),
        "back": Sense("touch_N", (1, SIDES.index("back")), 1.0),
        "full": Sense.between("touch_N", 2, 8.0, 10.0, 5.0),
    }
    assert currents(inputs_of(sources), felt(np.zeros(3), touch_N=touch)) == [[22.0, 6.0, 5.0]]


def test_hysteresis_keeps_a_switch_on_and_not_off():
    up_and_down = [0.016, 0.012, 0.008, 0.012, 0.014, 0.016, 0.012, 0.008]
    steps = [felt([each], 0.001 * step) for step, each in enumerate(up_and_down)]
    sources = {
        "plain": Switch("lengthening_m", 0, 0.01, 1.0),
        "lasting": Switch("lengthening_m", 0, 0.01, 3.0, hysteresis=0.005),
    }
    found = np.array(currents(inputs_of(sources, 1), *steps)).T
    assert found[0].tolist() == [0, 0, 1, 0, 0, 0, 0, 1]
    assert found[1].tolist() == [0, 0, 3, 3, 3, 0, 0, 3]


def test_sources_have_their_time():
    """A switch that was kept off is off for its hysteresis too; 200 steps of 1 ms add up to nearly 0.2 s."""
    sources = {
        "sense": Sense("lengthening_m", 0, 1.0, from_s=0.2, least_nA=4.0),
        "held": Switch("lengthening_m", 0, 0.01, 1.0, 0.005, from_s=0.2),
        "pulse": Pulse(2.0, 0.2),
        "never": Pulse(2.0, 0.0),
    }
    longer = {198: 0.008, 199: 0.008, 200: 0.012, 201: 0.012}
    one = inputs_of(sources, 1)
    for step in (0, 1):
        one.step(felt([0.0], 0.001 * step))
    found = currents(one, *(felt([each], step * 0.001 + 1e-12) for step, each in longer.items()))
    assert found == [[0, 0, 2, 0], [0, 0, 2, 0], [4, 0, 0, 0], [4, 0, 0, 0]]
    one.reset(0)
    before = one.potential_mV.copy()
    one.stride(felt([0.008]), 250)
    assert (one.potential_mV - before).round(9).tolist() == [4 * 50, 50, 2 * 200, 0]


@given(n_sensors=st.integers(1, 40), seed=st.integers(0, 99))
def test_lengthening_is_the_mean_and_the_same_bits_in_any_memory_layout(n_sensors, seed):
    stretch, rest = np.random.default_rng(seed).uniform(0.01, 0.2, (2, 3, n_sensors))
    longer = lengthening_m(stretch, rest)
    assert longer == pytest.approx(stretch.mean(axis=-1) - rest.mean(axis=-1), abs=1e-14)
    assert np.array_equal(longer, lengthening_m(np.asfortranarray(stretch), np.asfortranarray(rest)))


def test_what_does_not_fit_is_refused(subtests: pytest.Subtests) -> None:
    network = Network()
    network.add_neuron("a", Neuron())
    network.add_input("in", "a")
    network.add_output("out", "a")
    for make, words in (
        (lambda: Sense("stretch", 0, 1.0), "unknown quantity 'stretch'"),
        (lambda: Switch("touch", 0, 1.0, 1.0), "did you mean 'touch_N'"),
        (lambda: Sense("touch_N", 0, 1.0, least_nA=2.0, most_nA=1.0), "least_nA = 2 must be at most"),
        (lambda: Sense("touch_N", 0, 1.0, span=0.0), "span must not be 0"),
        (lambda: Readout(["out"], from_mV=20.0), "to_mV must differ from from_mV"),
        (lambda: Readout(["out", "out"], ["out"]), "1 outputs expand and 2 contract"),
        (lambda: Circuit(network, {"ni": 1.0}, Readout(["out"])), "no input 'ni': did you mean 'in'"),
        (lambda: Circuit(network, {}, Readout(["oot"])), "no output 'oot': did you mean 'out'"),
        (lambda: inputs_of({"in": Sense("lengthening_m", 7, 1.0)}), "senses no lengthening_m at 7"),
        (lambda: inputs_of({"in": Sense("touch_N", (0, 9), 1.0)}), r"senses no touch_N at \(0, 9\)"),
        (lambda: controller(n_muscles=4), "n_muscles"),
        (lambda: controller(n_segments=2), "n_segments"),
    ):
        with subtests.test(words), pytest.raises(ConfigError, match=words):
            make()
    blind = inputs_of({"in": Sense("touch_N", 0, 1.0)})
    with pytest.raises(ConfigError, match="needs touch_N, which the body does not sense"):
        blind.step(felt(np.zeros(3), touch_N=np.zeros((0, 4))))


def test_the_kick_acts_on_the_first_contraction_neuron_in_the_first_step_only():
    kicked, still = controller(kick_nA=1.0), controller(kick_nA=0.0)
    for step in range(2):
        for one in (kicked, still):
            one.step(felt([OFF] * 3, step * 1e-3))
        if step == 0:
            a, b = potential(kicked), potential(still)
            assert a.pop("contraction_1") - b.pop("contraction_1") == pytest.approx(1.0 / 5.0, abs=1e-12)
            assert a == b
            still.set_state({**still.get_state(), "potential": kicked.get_state()["potential"]})
    assert potential(kicked) == potential(still)


def test_what_is_sensed_at_the_beginning_acts_during_the_step():
    one, dark = controller(), controller()
    one.step(felt([OFF, 0.0, OFF]))
    dark.step(felt([OFF, OFF, OFF]))
    a, b = potential(one), potential(dark)
    assert a.pop("sensory_2") - b.pop("sensory_2") == pytest.approx(20.0 / 5.0, abs=1e-12)
    assert a == b
    assert np.asarray(one.read(frame=False)["sensor_on"]).tolist() == [0.0, 1.0, 0.0]


def gives(one: CircuitController, **potential_mV: list[float]) -> Array:
    """Activation at potentials of the named roles; every other neuron is at 7 mV."""
    names = list(one.stepper.arrays.neurons)
    potentials = np.full(len(names), 7.0)
    for role, values in potential_mV.items():
        for segment, value in enumerate(values, start=1):
            potentials[names.index(f"{role}_{segment}")] = value
    return one.activation(potentials)


@pytest.mark.parametrize("n_muscles", [4, 8])
@pytest.mark.parametrize("kind", ["sns", "adaptive", "sns-robust"])
def test_activation_is_the_sigmoid_of_each_segments_half_centre(kind: str, n_muscles: int) -> None:
    slope: dict[str, Any] = {"activation_slope_per_mV": SLOPE_PER_MV}
    fields: dict[str, Any] = {"network": slope} if kind == "adaptive" else slope
    one = controller(kind, 4, n_muscles, **fields)
    contraction, expansion = [20.0, -3.0, 0.5, 11.0], [1.0, 18.0, 0.5, -40.0]
    expected = 1.0 / (1.0 + np.exp(-SLOPE_PER_MV * (np.array(contraction) - expansion)))
    assert gives(one, contraction=contraction, expansion=expansion) == pytest.approx(
        expected.repeat(n_muscles // 4), rel=1e-12
    )


def test_linear_activation_is_clipped_at_the_range() -> None:
    one = controller(n_segments=4, activation="linear", range_mV=RANGE_MV)
    found = gives(one, contraction=[15.0, 7.5, 0.0, -40.0], expansion=[0.0, 0.0, 7.5, 20.0])
    assert found == pytest.approx([1.0, 0.75, 0.25, 0.0], abs=1e-12)


KINDS: dict[str, dict[str, Any]] = {
    "sns": {},
    "adaptive": {"drive": 0.3},
    "sns-pressure": {},
    "sns-robust": {"motor_time_constant_s": 0.2, "descending": {"lift": 0.45}},
}
HELD = {"startup_hold_s": 0.013, "hysteresis_m": 0.004}


@pytest.mark.parametrize("kind", KINDS)
def test_a_stride_is_its_steps_also_where_lengths_go_on_at_their_rates(kind: str) -> None:
    stepped, strided, unmoved = (controller(kind, 4, sensor=HELD, **KINDS[kind]) for _ in range(3))
    rng, moved_by_mV = np.random.default_rng(4), 0.0
    for first in range(0, 200, 10):
        touch, rates = rng.uniform(0.0, 8.0, (4, len(SIDES))), rng.uniform(-4.0, 4.0, (4, 3))
        sensation = felt(rng.uniform(0.0, 0.06, (4, 3)), first * 0.001, touch, rates)
        expected = [stepped.step(sensation.later((first + k) * 0.001)) for k in range(10)]
        # A mean of lengths carried on, and a length carried on by a mean of rates, differ by rounding.
        np.testing.assert_allclose(strided.stride(sensation, 10), expected, rtol=1e-9, atol=1e-12)
        unmoved.stride(replace(sensation, stretch_rate_m_per_s=np.zeros((0, 0))), 10)
        np.testing.assert_allclose(strided.potential_mV, stepped.potential_mV, rtol=1e-9, atol=1e-9)
        moved_by_mV = max(moved_by_mV, float(np.abs(strided.potential_mV - unmoved.potential_mV).max()))
    assert moved_by_mV > 0.1, "the rates are of consequence"
    assert {signal.name: signal.shape for signal in stepped.recordable().signals} == {
        name: np.shape(value) for name, value in stepped.read(frame=False).items()
    }


def test_a_restored_controller_continues_bit_for_bit():
    sensor = {"hysteresis_m": 0.003, "startup_hold_s": 0.02}
    rng = np.random.default_rng(0)
    steps = [felt(rng.uniform(0, OFF, 3), i * 1e-3) for i in range(400)]
    one, other, fresh = (controller(sensor=sensor) for _ in range(3))
    for sensation in steps[:150]:
        one.step(sensation)
    state = one.get_state()
    other.set_state(state)
    for sensation in steps[150:]:
        assert np.array_equal(one.step(sensation), other.step(sensation))
    # The saved arrays are copies, and reset is a true beginning.
    again = one.get_state()
    assert {k: (v.shape, v.dtype) for k, v in again.items()} == {k: (v.shape, v.dtype) for k, v in state.items()}
    one.reset(5)
    assert all(np.array_equal(one.step(s), fresh.step(s)) for s in steps[:150])


def test_sodium_gates_are_recorded_where_there_are_any():
    for start, sign in (("steady", 1.0), ("toolbox", -1.0)):
        one = controller(gate_start=start)
        gate = np.asarray(one.read(frame=False)["sodium_gate"]).reshape(3, 4)
        assert np.isnan(gate[:, 2:]).all()
        u = one.potential_mV.reshape(3, 4)[:, :2]
        np.testing.assert_allclose(gate[:, :2], 1 / (1 + 0.5 * np.exp(sign * 0.05 * u)), rtol=1e-12)
    recordable = one.recordable()
    assert list(recordable.coords["neuron"]) == neuron_names(3)
    assert recordable.attrs["conductance_sodium_uS"] == pytest.approx(1.048507, abs=5e-7)
    assert one.read(frame=True) == {}


def test_alarm_rings_when_the_step_is_too_long_and_only_then():
    good, bad = controller(), controller(timestep_s=0.05)
    for step in range(200):
        good.step(felt([OFF, 0.0, 0.0], step * 1e-3))
        assert good.alarm() is None
        if bad.alarm() is None:
            bad.step(felt([OFF, 0.0, 0.0], step * 0.05))
    message = bad.alarm()
    assert message is not None
    assert "clock.control_timestep_s = 0.05 is too long" in message


def test_the_first_segment_is_not_held_by_its_load_at_the_start() -> None:
    """Its first contraction is the paper's; without the hold at the start its own load ends it."""
    lasted = []
    for kind, hold_s in (("sns", 0.2), ("sns-pressure", 0.2), ("sns-pressure", 0.0)):
        one, touch = controller(kind, 4, sensor={"tolerance_m": 0.005, "startup_hold_s": hold_s}), np.zeros((4, 4))
        touch[:, 0], touch[:, 2] = 4.5, 1.5
        lasted.append(int((one.stride(felt([0.02, 0.0, 0.0, 0.0], touch_N=touch), 190)[:, 0] > 0.5).sum()))
    paper, held, loaded = lasted
    assert held == paper > 50
    assert loaded < held
