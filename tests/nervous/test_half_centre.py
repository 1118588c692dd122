"""Half-centres: transmission, the bifurcation, and the hold."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.errors import ConfigError
from annelid.nervous import HalfCentre, Network, Neuron, PeristalsisParameters, add_half_centre, add_hold

R = 20.0


def lead(
    half_centre: HalfCentre, duration_ms: int = 12_000, initial_mV: tuple[float, float] | None = None
) -> np.ndarray:
    """By how much the first neuron is above the second after every step of 1 ms, mV."""
    network = Network()
    add_half_centre(network, "first", "second", half_centre, initial_mV)
    trace = network.compile(1.0, "heun").run(np.empty((duration_ms, 0)))[:, 0]
    return trace[:, 0] - trace[:, 1]


def period_ms(half_centre: HalfCentre) -> float:
    """Time between the last two instants at which the first neuron overtakes the second; infinite without."""
    ahead = lead(half_centre) >= 0.0
    overtaken = np.flatnonzero(ahead[1:] & ~ahead[:-1])
    return float(overtaken[-1] - overtaken[-2]) if len(overtaken) > 2 else np.inf


@settings(max_examples=25)
@given(st.floats(0.0, R), st.floats(0.2, 3.0), st.floats(0.5, 2.0), st.floats(100.0, 1000.0))
def test_transmission_is_exact_at_both_ends_and_known_in_between(
    u: float, gain: float, leak: float, excitatory: float
) -> None:
    p = HalfCentre(leak_conductance_uS=leak, excitatory_reversal_mV=excitatory)
    for potential in (0.0, u, R):
        network = Network()
        network.add_neuron("before", Neuron(5.0, leak, bias_nA=leak * potential), potential)
        network.add_neuron("behind", p.leaky_neuron)
        network.add_synapse("before", "behind", p.transmission(gain))
        end = network.compile(0.4 * network.stable_timestep_ms()).run(np.empty((300, 0)))[-1, 0, 1]
        error = gain**2 * potential * (R - potential) / (excitatory - gain * (R - potential))
        assert end == pytest.approx(gain * potential + error, abs=1e-8)


def test_delta_is_the_distance_from_the_bifurcation(subtests: pytest.Subtests) -> None:
    for slope in (0.04, 0.05, 0.06):
        with subtests.test(f"{slope!r:.60}"):
            deltas = [-0.1, -0.01, 0.01, 0.1, 1.0]
            periods = [period_ms(HalfCentre(bifurcation_mV=d, gate_slope_per_mV=slope)) for d in deltas]
            assert np.array_equal(np.isfinite(periods), np.array(deltas) > 0)
            assert np.all(np.diff(periods[2:]) < 0)


def test_with_negative_delta_both_states_are_stable() -> None:
    p = HalfCentre(bifurcation_mV=-0.05)
    assert lead(p, 8000, (20.0, -0.045))[-1] == pytest.approx(20.0, abs=0.3)
    assert lead(p, 8000, (-0.045, 20.0))[-1] == pytest.approx(-20.0, abs=0.3)


def test_the_two_neurons_take_even_turns_half_a_period_apart() -> None:
    late = lead(HalfCentre())[4000:]
    assert np.mean(late > 0) == pytest.approx(0.5, abs=0.05)
    half = round(period_ms(HalfCentre()) / 2)
    np.testing.assert_allclose(late[half : 3 * half], -late[: 2 * half], atol=2.5)


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


def test_impossible_designs_are_refused(subtests: pytest.Subtests) -> None:
    for call, message in (
        (lambda: HalfCentre(bifurcation_mV=-40.0), "bifurcation_mV"),
        (lambda: HalfCentre(offset_mV=0.0), "offset_mV"),
        (lambda: HalfCentre(excitatory_reversal_mV=20.0), "excitatory_reversal_mV"),
        (lambda: HalfCentre(inhibitory_reversal_mV=1.0), "inhibitory_reversal_mV"),
        (lambda: HalfCentre().transmission(0.0), "gain"),
        (lambda: HalfCentre().transmission(9.8), "excitatory_reversal_mV / range_mV = 9.7"),
        (lambda: PeristalsisParameters(bifurcation_mV=-0.01), "bifurcation_mV must be positive"),
    ):
        with subtests.test(f"{call!r:.60}"), pytest.raises(ConfigError, match=message):
            call()
