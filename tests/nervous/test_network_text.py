"""Networks as TOML and as Markdown."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.errors import ConfigError
from annelid.nervous import (
    Channel,
    GapJunction,
    Gate,
    Network,
    Neuron,
    Synapse,
)

any_float = st.floats(allow_nan=False, allow_infinity=False)
positive = st.floats(1e-300, 1e300)
conductance = st.floats(0, 1e300)
gate = st.builds(Gate, any_float, any_float, positive, any_float, st.none() | positive)
channel = st.builds(Channel, conductance, any_float, st.lists(gate, max_size=3).map(tuple))
neuron = st.builds(Neuron, positive, conductance, any_float, any_float, st.lists(channel, max_size=2).map(tuple))
ends = st.floats(-50, 0), st.floats(1, 50)
kind = st.one_of(
    st.builds(Synapse, conductance, any_float, *ends),
    st.builds(GapJunction, conductance, st.booleans()),
)
# All characters that text can hold, quotes, line ends and delete among them.
words = st.text(st.characters(exclude_categories=["Cs"]) | st.sampled_from('"\\\n\r\t\x00\x7f|#='), max_size=8)


@st.composite
def networks(draw) -> Network:
    network = Network(draw(words))
    names = draw(st.lists(words, max_size=4, unique=True))
    for name in names:
        network.add_neuron(name, draw(neuron), draw(any_float))
    if names:
        name = st.sampled_from(names)
        for source, target, what in draw(st.lists(st.tuples(name, name, kind), max_size=5)):
            if isinstance(what, GapJunction):
                network.add_gap_junction(source, target, what)
            else:
                network.add_synapse(source, target, what)
        for entry in draw(st.lists(words, max_size=2, unique=True)):
            network.add_input(entry, draw(st.lists(name, max_size=3)))
        for entry in draw(st.lists(words, max_size=2, unique=True)):
            network.add_output(entry, draw(name))
    return network


def contents(network: Network):
    return (
        network.name,
        list(network.neurons.items()),
        list(network.initial_mV.items()),
        network.connections,
        list(network.inputs.items()),
        list(network.outputs.items()),
    )


@settings(max_examples=150)
@given(network=networks())
def test_toml_round_trip_is_exact(network):
    text = network.to_toml()
    again = Network.from_toml(text)
    assert contents(again) == contents(network)
    assert again.to_toml() == text


def test_fields_left_out_take_their_defaults_and_whole_numbers_are_numbers():
    network = Network.from_toml(
        """
        [[neuron]]
        name = "a"
        rest_mV = -60
        [[neuron.channels]]
        conductance_uS = 1
        reversal_mV = 110

        [[connection]]
        source = "a"
        target = "a"
        kind = "gap_junction"
        conductance_uS = 0.5
        """
    )
    assert network.neurons["a"] == Neuron(rest_mV=-60.0, channels=(Channel(1.0, 110.0),))
    assert network.initial_mV["a"] == -60.0
    assert network.connections[0].kind == GapJunction(0.5)


def test_faulty_texts_are_refused(subtests: pytest.Subtests) -> None:
    for text, message in (
        ("name = ", "not valid TOML"),
        ("nam = 'x'", "unknown field 'nam': did you mean 'name'"),
        ("name = 3", "name must be a string"),
        ("neuron = 3", r"neuron must be an array of tables, \[\[neuron\]\]"),
        ("[[neuron]]\nrest_mV = 1.0", "neuron 1: name is missing"),
        ("[[neuron]]\nname = 'a'\nrest = 1.0", r"neuron 1 \('a'\): unknown field 'rest': did you mean 'rest_mV'"),
        ("[[neuron]]\nname = 'a'\nrest_mV = true", "rest_mV must be a number, not True"),
        ("[[neuron]]\nname = 'a'\ncapacitance_nF = -1", r"neuron 1 \('a'\): .*capacitance_nF must be positive"),
        ("[[neuron]]\nname = 'a'\nfiring = 1", "firing has been removed"),
        ("[[neuron]]\nname = 'a'\n[[neuron]]\nname = 'a'", "'a' exists already"),
        ("[[connection]]\nsource = 'a'\ntarget = 'a'\nkind = 'synaps'", "did you mean 'synapse'"),
        ("[[connection]]\nsource = 'a'\ntarget = 'a'\nkind = 'synapse'", "conductance_uS is missing"),
        ("[[connection]]\nsource = 'a'\ntarget = 'a'\nkind = 'spiking_synapse'", "has been removed"),
        ("[[input]]\nname = 'i'\ntargets = 'a'", "targets must be a list of names"),
        ("[[input]]\nname = 'i'\ntargets = ['b']", "unknown neuron 'b'"),
        (
            "[[neuron]]\nname = 'a'\n[[connection]]\nsource = 'a'\ntarget = 'a'\nkind = 'gap_junction'\n"
            "conductance_uS = 1.0\nrectified = 1",
            "rectified must be true or false",
        ),
    ):
        with subtests.test(f"{text!r:.60}"), pytest.raises(ConfigError, match=message):
            Network.from_toml(text)


def small_network() -> Network:
    network = Network("a & b <small>")
    network.add_neuron("up", Neuron(channels=(Channel(1.0, 110.0, (Gate(0.1, time_constant_ms=300.0),)),)))
    network.add_neuron("down|side", Neuron())
    network.add_neuron('say "x"', Neuron(rest_mV=-60.0))
    network.add_synapse("up", "down|side", Synapse(0.5, 194.0))
    network.add_synapse("down|side", "up", Synapse(0.25, -40.0))
    network.add_synapse("up", 'say "x"', Synapse(0.125, -50.0))
    network.add_gap_junction("up", 'say "x"', GapJunction(0.75, rectified=True))
    network.add_gap_junction("down|side", 'say "x"', GapJunction(0.75))
    network.add_synapse("up", "up", Synapse(0.1, -40.0))
    network.add_input("stimulus", ["up", "down|side"])
    network.add_output("read", "up")
    return network
