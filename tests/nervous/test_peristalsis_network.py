"""The peristalsis network: its conductances, wiring and equations, against the published ones."""

import math
from dataclasses import asdict

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.errors import ConfigError
from annelid.nervous import (
    Network,
    Neuron,
    PeristalsisParameters,
    Synapse,
    peristalsis_network,
)

PUBLISHED_uS = {
    "sodium": 1.048507,
    "half_centre": 0.516653,
    "sensory_to_expansion": 0.114691,
    "sensory_to_contraction": 0.514153,
    "expansion_to_relay": 0.114371,
    "sensory_to_relay": 0.557471,
    "relay_to_next_sensory": 0.5,
}


def test_conductances_are_those_of_the_paper():
    conductances = asdict(PeristalsisParameters().conductances)
    assert {name: round(value, 6) for name, value in conductances.items()} == PUBLISHED_uS


parameters = st.builds(
    PeristalsisParameters,
    leak_conductance_uS=st.floats(0.5, 2),
    range_mV=st.floats(10, 30),
    bifurcation_mV=st.floats(0.001, 0.1),
    offset_mV=st.floats(0.01, 0.5),
    inhibitory_reversal_mV=st.floats(-60, -30),
    excitatory_reversal_mV=st.floats(100, 250),
    sodium_reversal_mV=st.floats(80, 130),
)


@given(p=parameters)
def test_isolated_neuron_rests_at_the_range(p):
    network = Network()
    network.add_neuron("a", Neuron(p.capacitance_nF, p.leak_conductance_uS, channels=(p.sodium_channel,)), p.range_mV)
    assert network.compile().run(np.empty((50, 0)))[-1, 0, 0] == pytest.approx(p.range_mV, abs=1e-6)


@given(p=parameters)
def test_inhibited_half_centre_rests_at_the_bifurcation_offset(p):
    network = Network()
    half_centre = Neuron(p.capacitance_nF, p.leak_conductance_uS, channels=(p.sodium_channel,))
    network.add_neuron("inhibited", half_centre, p.bifurcation_mV)
    network.add_neuron("partner", Neuron(rest_mV=2 * p.range_mV))
    network.add_synapse(
        "partner",
        "inhibited",
        Synapse(p.conductances.half_centre, p.inhibitory_reversal_mV, 0.0, p.range_mV),
    )
    trace = network.compile().run(np.empty((50, 0)))
    assert trace[-1, 0, 0] == pytest.approx(p.bifurcation_mV, abs=1e-6)


@given(p=parameters)
def test_interneurons_rest_where_the_rules_say(p):
    """Relay at R, relay at 0, sensory neuron at 0, by steady potentials with transmission left unclipped."""
    g, reach, held = p.conductances, p.range_mV, p.range_mV + p.offset_mV
    leak, excitatory, inhibitory = (
        p.leak_conductance_uS,
        p.excitatory_reversal_mV,
        p.inhibitory_reversal_mV,
    )
    network = Network()
    network.add_neuron("expansion", Neuron(rest_mV=held), held)
    network.add_neuron("sensory", Neuron(rest_mV=reach), reach)
    # Saturation beyond what is reached keeps transmission linear; the conductance grows alike.
    for name in ("driven relay", "silenced relay", "silenced sensory"):
        network.add_neuron(name, Neuron(p.capacitance_nF, leak))
    drive = Synapse(2 * g.expansion_to_relay, excitatory, 0.0, 2 * reach)
    network.add_synapse("expansion", "driven relay", drive)
    network.add_synapse("expansion", "silenced relay", drive)
    network.add_synapse("sensory", "silenced relay", Synapse(g.sensory_to_relay, inhibitory, 0.0, reach))
    network.add_synapse("sensory", "silenced sensory", Synapse(g.relay_to_next_sensory, inhibitory, 0.0, reach))
    network.add_input("stretch", "silenced sensory")
    current = np.full((300, 1), leak * reach)
    assert network.compile().run(current)[-1, 0, 2:] == pytest.approx([reach, 0.0, 0.0], abs=1e-6)


def oracle(n: int, steps: int, stretch_on, scheme: str):
    """The network's equations as REFERENCE.md and the paper print them, neuron by neuron."""
    big = {name: {} for name in ("u1", "u2", "u3", "u4", "h1", "h2")}
    for j in range(n):
        big["u1"][j], big["u2"][j] = (20.0, 0.0) if j == 0 else (-0.1, 20.1)
        big["u3"][j], big["u4"][j] = (0.0 if j == 0 else 20.0), 0.0

    def h_inf(u):
        return 1 / (1 + 0.5 * math.exp(0.05 * u))

    def sodium(u, h):
        return g["sodium"] / (1 + math.exp(0.05 * (20 - u))) * h * (110 - u)

    def h_next(u, h):
        tau = 300 * h_inf(u) * math.sqrt(0.5 * math.exp(0.05 * u))
        return h + (h_inf(u) - h) / tau

    def a(u):
        return min(max(u / 20, 0.0), 1.0)

    g = asdict(PeristalsisParameters().conductances)
    for j in range(n):
        big["h1"][j], big["h2"][j] = h_inf(big["u1"][j]), h_inf(big["u2"][j])
    rows = []
    for t in range(steps):
        u1, u2, u3, u4, h1, h2 = (dict(big[k]) for k in ("u1", "u2", "u3", "u4", "h1", "h2"))
        for j in range(n):
            new_h1, new_h2 = h_next(u1[j], h1[j]), h_next(u2[j], h2[j])
            used_h1, used_h2 = (new_h1, new_h2) if scheme == "toolbox" else (h1[j], h2[j])
            i1 = -u1[j] + sodium(u1[j], used_h1)
            i1 += g["half_centre"] * a(u2[j]) * (-40 - u1[j])
            i1 += g["sensory_to_contraction"] * a(u3[j]) * (-40 - u1[j])
            i1 += 1.0 if t == 0 and j == 0 else 0.0
            i2 = -u2[j] + sodium(u2[j], used_h2)
            i2 += g["half_centre"] * a(u1[j]) * (-40 - u2[j])
            i2 += g["sensory_to_expansion"] * a(u3[j]) * (194 - u2[j])
            i3 = -u3[j] + g["relay_to_next_sensory"] * a(u4[(j - 1) % n]) * (-40 - u3[j]) + 20.0 * stretch_on[t, j]
            i4 = -u4[j] + g["expansion_to_relay"] * a(u2[j]) * (194 - u4[j])
            i4 += g["sensory_to_relay"] * a(u3[j]) * (-40 - u4[j])
            for key, u, i in (("u1", u1, i1), ("u2", u2, i2), ("u3", u3, i3), ("u4", u4, i4)):
                big[key][j] = u[j] + i / 5.0
            big["h1"][j], big["h2"][j] = new_h1, new_h2
        rows.append([big[k][j] for j in range(n) for k in ("u1", "u2", "u3", "u4")])
    return np.array(rows)


@pytest.mark.parametrize("scheme", ["euler", "toolbox"])
def test_traces_equal_the_printed_equations(scheme):
    n, steps = 5, 600
    on = np.random.default_rng(1).random((steps // 50, n)).repeat(50, axis=0) < 0.5
    kick = np.zeros((steps, 1))
    kick[0] = 1.0
    stepper = peristalsis_network(n).compile(1.0, scheme)
    trace = stepper.run(np.hstack([np.where(on, 20.0, 0.0), kick]))
    np.testing.assert_allclose(trace[1:, 0], oracle(n, steps, on, scheme), rtol=1e-9, atol=1e-9)


def test_held_segments_stay_expanded():
    """With every sensor on the worm is silent: nothing contracts (a known absorbing state)."""
    stepper = peristalsis_network(4).compile()
    state = stepper.initial_state()
    trace = stepper.run(np.tile([20.0] * 4 + [0.0], (6000, 1)), state)
    contraction, expansion = trace[3000:, 0, 0::4], trace[3000:, 0, 1::4]
    assert np.all(contraction < 0.0)
    assert np.all(expansion > 20.0)


def test_what_has_no_solution_is_refused():
    with pytest.raises(ConfigError, match="half_centre"):
        peristalsis_network(3, PeristalsisParameters(bifurcation_mV=50.0))
    with pytest.raises(ConfigError, match="at least 3"):
        peristalsis_network(2)
