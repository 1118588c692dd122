"""Half-centres: the bifurcation, the hold, and the search for a period."""

import numpy as np
import pytest

from annelid.errors import ConfigError
from annelid.nervous import (
    HalfCentre,
    Network,
    Neuron,
    PeristalsisParameters,
    add_half_centre,
    add_hold,
    find_period,
    half_centre_network,
    half_centre_of_period,
    oscillation_periods,
)


def test_delta_is_the_distance_from_the_bifurcation(subtests: pytest.Subtests) -> None:
    for slope in (0.04, 0.05, 0.06):
        with subtests.test(f"{slope!r:.60}"):
            deltas = [-0.1, -0.01, 0.01, 0.1, 1.0]
            periods = oscillation_periods([HalfCentre(bifurcation_mV=d, gate_slope_per_mV=slope) for d in deltas])
            assert np.array_equal(np.isfinite(periods), np.array(deltas) > 0)
            assert np.all(np.diff(periods[2:]) < 0)


def test_with_negative_delta_both_states_are_stable():
    for first in (True, False):
        network = Network()
        p = HalfCentre(bifurcation_mV=-0.05)
        add_half_centre(network, "a", "b", p, (20.0, -0.045) if first else (-0.045, 20.0))
        end = network.compile(1.0, "heun").run(np.empty((8000, 0)))[-1, 0]
        assert end[0 if first else 1] == pytest.approx(20.0, abs=0.2)
        assert end[1 if first else 0] < 0.0


def test_the_two_neurons_take_even_turns_half_a_period_apart():
    network = half_centre_network()
    trace = network.compile(1.0, "heun").run(np.zeros((9000, 2)))[4000:, 0]
    lead = trace[:, 0] - trace[:, 1]
    assert np.mean(lead > 0) == pytest.approx(0.5, abs=0.05)
    (period,) = oscillation_periods([HalfCentre()])
    half = round(period / 2)
    np.testing.assert_allclose(trace[half : 3 * half, 0], trace[: 2 * half, 1], atol=1.5)


def test_period_grows_with_the_gate_time_constant_and_many_at_once_are_as_one_by_one():
    designs = [HalfCentre(gate_time_constant_ms=tau) for tau in (100.0, 200.0, 300.0)]
    together = oscillation_periods(designs)
    np.testing.assert_allclose(together, [oscillation_periods([design])[0] for design in designs], rtol=1e-3)
    assert np.all(np.diff(together) > 0)


def test_hold_keeps_the_half_centre_beyond_its_range(subtests: pytest.Subtests) -> None:
    for offset in (0.05, 0.1, 0.5):
        with subtests.test(f"{offset!r:.60}"):
            p = HalfCentre(offset_mV=offset)
            network = Network()
            network.add_neuron("holder", Neuron(bias_nA=20.0), 20.0)
            add_half_centre(network, "a", "b", p, (-offset, 20.0 + offset))
            add_hold(network, "holder", down="a", up="b", half_centre=p)
            a, b = network.compile(1.0).run(np.empty((6000, 0)))[-1, 0, 1:]
            assert a < -offset
            assert b >= 20.0


@pytest.mark.parametrize(
    ("wanted", "parameter"),
    [(1500.0, "gate_time_constant_ms"), (1500.0, "bifurcation_mV"), (800.0, "gate_slope_per_mV")],
)
def test_search_finds_the_wanted_period(wanted, parameter):
    found = half_centre_of_period(wanted, parameter=parameter)
    (period,) = oscillation_periods([found])
    assert period == pytest.approx(wanted, rel=0.01)
    names = [name for name in HalfCentre.__dataclass_fields__ if getattr(found, name) != getattr(HalfCentre(), name)]
    assert names == [parameter]


@pytest.mark.parametrize("wanted", [100.0, 9000.0])
def test_unattainable_periods_are_refused_with_the_attainable_range(wanted):
    ends = oscillation_periods([HalfCentre(gate_time_constant_ms=tau) for tau in (100.0, 200.0)])
    with pytest.raises(ConfigError, match=f"go from {ends[0]:.4g} to {ends[1]:.4g} ms"):
        half_centre_of_period(wanted, bounds=(100.0, 200.0))


def test_search_on_a_known_curve_passes_over_silence_and_refuses_a_gap():
    calls = []

    def curve(values, _):
        calls.append(len(values))
        return np.where(values < 2.0, np.inf, 100.0 * values)

    assert find_period(curve, 777.0, (1.0, 20.0), 1e-6) == pytest.approx(7.77, rel=1e-6)
    assert len(calls) < 12
    with pytest.raises(ConfigError, match=r"cannot be had with parameter from 2 to 20.*from 200 to 4000 ms"):
        find_period(lambda v, _: np.where(v < 6.0, 100.0 * v, 200.0 * v), 900.0, (2.0, 20.0))
    with pytest.raises(ConfigError, match="nothing oscillates with gate from 1 to 2"):
        find_period(lambda v, _: np.full(v.size, np.inf), 900.0, (1.0, 2.0), parameter="gate")


def test_impossible_requests_are_refused(subtests: pytest.Subtests) -> None:
    for call, message in (
        (lambda: half_centre_of_period(1500.0, parameter="gate_time_constant"), "did you mean 'gate_time_constant_ms'"),
        (lambda: half_centre_of_period(-1.0), "period_ms"),
        (lambda: half_centre_of_period(1500.0, bounds=(300.0, 100.0)), "bounds of gate_time_constant_ms"),
        (lambda: half_centre_of_period(1500.0, bounds=(0.0, 100.0)), "bounds of gate_time_constant_ms"),
        (lambda: oscillation_periods([]), "at least one"),
        (lambda: HalfCentre(bifurcation_mV=-40.0), "bifurcation_mV"),
        (lambda: HalfCentre(offset_mV=0.0), "offset_mV"),
        (lambda: PeristalsisParameters(bifurcation_mV=-0.01), "bifurcation_mV must be positive"),
    ):
        with subtests.test(f"{call!r:.60}"), pytest.raises(ConfigError, match=message):
            call()
