"""Properties of the batched stepper on random networks, and its orders of accuracy."""

from typing import NamedTuple

import numpy as np
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
    PeristalsisParameters,
    Synapse,
    persistent_sodium,
)

SCHEMES = ("euler", "toolbox", "heun")
TIMESTEP_MS = 0.5


class Recipe(NamedTuple):
    """What a random network consists of, by index, so that it can be built in any order."""

    neurons: list[Neuron]
    initial: list[float]
    synapses: list[tuple[int, int, Synapse]]
    junctions: list[tuple[int, int, GapJunction]]
    inputs: list[list[int]]

    def build(self, order: list[int]) -> Network:
        network = Network()
        for i in order:
            network.add_neuron(f"n{i}", self.neurons[i], self.initial[i])
        for pre, post, synapse in self.synapses:
            network.add_synapse(f"n{pre}", f"n{post}", synapse)
        for pre, post, junction in self.junctions:
            network.add_gap_junction(f"n{pre}", f"n{post}", junction)
        for k, targets in enumerate(self.inputs):
            network.add_input(f"i{k}", [f"n{t}" for t in targets])
        return network


sodium = st.builds(persistent_sodium, st.floats(0.1, 1.5), time_constant_ms=st.floats(50, 300))
other_channel = st.builds(
    lambda g, e, power, slope, tau: Channel(
        g,
        e,
        (
            Gate(slope, 10.0, power=power),
            Gate(-slope, 5.0, 0.7, time_constant_ms=tau),
            Gate(slope, 0.0, time_constant_ms=2 * tau),
        ),
    ),
    st.floats(0.1, 1.0),
    st.floats(-40, 110),
    st.integers(1, 3),
    st.floats(0.01, 0.08),
    st.floats(50, 300),
)
neuron = st.builds(
    Neuron,
    st.floats(4, 10),
    st.floats(0.5, 1.5),
    st.floats(-5, 5),
    st.floats(-2, 2),
    st.one_of(st.just(()), st.tuples(sodium), st.tuples(sodium, other_channel), st.tuples(other_channel)),
)
synapse = st.builds(Synapse, st.floats(0, 0.6), st.floats(-60, 194), st.sampled_from([0.0, -5.0]), st.floats(5, 30))


@st.composite
def recipes(draw) -> Recipe:
    n = draw(st.integers(1, 5))
    who = st.integers(0, n - 1)
    pairs = st.tuples(who, who).filter(lambda p: p[0] != p[1])
    junction = st.builds(GapJunction, st.floats(0, 0.3), st.booleans())
    return Recipe(
        draw(st.lists(neuron, min_size=n, max_size=n)),
        draw(st.lists(st.floats(-20, 30), min_size=n, max_size=n)),
        draw(st.lists(st.tuples(who, who, synapse), max_size=8)),
        [] if n == 1 else [(*p, j) for p, j in draw(st.lists(st.tuples(pairs, junction), max_size=3))],
        draw(st.lists(st.lists(who, min_size=1, max_size=n, unique=True), max_size=3)),
    )


def random_inputs(recipe: Recipe, n_worms: int, seed: int, n_steps: int = 40):
    return np.random.default_rng(seed).uniform(-10, 20, (n_steps, n_worms, len(recipe.inputs)))


@settings(max_examples=60)
@given(recipe=recipes(), scheme=st.sampled_from(SCHEMES), n_worms=st.integers(2, 4), seed=st.integers(0, 99))
def test_batch_equals_single_runs(recipe, scheme, n_worms, seed):
    network = recipe.build(list(range(len(recipe.neurons))))
    inputs = random_inputs(recipe, n_worms, seed)
    batch = network.compile(TIMESTEP_MS, scheme, n_worms)
    start = batch.initial_state()
    start.potential += np.random.default_rng(seed).uniform(-10, 10, start.potential.shape)
    single = network.compile(TIMESTEP_MS, scheme)
    together = batch.run(inputs, start.copy())
    for worm in range(n_worms):
        state = single.initial_state()
        state.potential[0] = start.potential[worm]
        alone = single.run(inputs[:, worm], state)
        np.testing.assert_array_equal(together[:, worm], alone[:, 0])


@settings(max_examples=60)
@given(
    recipe=recipes(),
    scheme=st.sampled_from(SCHEMES),
    n_worms=st.integers(1, 3),
    chunks=st.lists(st.integers(0, 9), min_size=1, max_size=5),
    seed=st.integers(0, 99),
)
def test_many_steps_in_one_call_are_bitwise_as_many_calls(recipe, scheme, n_worms, chunks, seed):
    stepper = recipe.build(list(range(len(recipe.neurons)))).compile(TIMESTEP_MS, scheme, n_worms)
    together, singly = stepper.initial_state(), stepper.initial_state()
    for n_steps, inputs in zip(chunks, random_inputs(recipe, n_worms, seed, len(chunks)), strict=True):
        stepper.advance(together, inputs, n_steps)
        for _ in range(n_steps):
            stepper.advance(singly, inputs)
        np.testing.assert_array_equal(together.potential, singly.potential)
        np.testing.assert_array_equal(together.gate, singly.gate)


@settings(max_examples=60)
@given(recipe=recipes(), scheme=st.sampled_from(SCHEMES), seed=st.integers(0, 99), data=st.data())
def test_order_of_neurons_does_not_matter(recipe, scheme, seed, data):
    n = len(recipe.neurons)
    order = data.draw(st.permutations(range(n)))
    inputs = random_inputs(recipe, 1, seed)
    straight = recipe.build(list(range(n))).compile(TIMESTEP_MS, scheme).run(inputs)
    shuffled = recipe.build(order).compile(TIMESTEP_MS, scheme).run(inputs)
    np.testing.assert_allclose(shuffled, straight[:, :, order], rtol=1e-10, atol=1e-10)


@settings(max_examples=40)
@given(recipe=recipes(), scheme=st.sampled_from(SCHEMES), seed=st.integers(0, 99))
def test_gates_stay_between_0_and_1(recipe, scheme, seed):
    network = recipe.build(list(range(len(recipe.neurons))))
    stepper = network.compile(TIMESTEP_MS, scheme, 2)
    state = stepper.initial_state("toolbox")
    state.gate[0], state.gate[1] = 0.0, 1.0
    for inputs in random_inputs(recipe, 2, seed):
        stepper.advance(state, inputs)
        assert np.all((state.gate >= 0.0) & (state.gate <= 1.0))


def half_centre_with_neighbour(timestep_ms, scheme, duration_ms):
    """A smooth stretch of motion, clear of the corners of the synapses' clip."""
    p = PeristalsisParameters()
    network = Network()
    network.add_neuron("a", Neuron(channels=(p.sodium_channel,)), 5.0)
    network.add_neuron("b", Neuron(channels=(p.sodium_channel,)), 8.0)
    network.add_synapse("a", "b", Synapse(0.1, -40.0, -50.0, 100.0))
    network.add_synapse("b", "a", Synapse(0.1, 194.0, -50.0, 100.0))
    stepper = network.compile(timestep_ms, scheme)
    state = stepper.initial_state()
    state.gate[...] = 0.9
    for _ in range(round(duration_ms / timestep_ms)):
        stepper.advance(state)
    return np.concatenate([state.potential.ravel(), state.gate.ravel()])


@pytest.mark.parametrize(("scheme", "order"), [("euler", 1), ("toolbox", 1), ("heun", 2)])
def test_order_of_accuracy(scheme, order):
    exact = half_centre_with_neighbour(1 / 128, "heun", 16.0)
    errors = [np.linalg.norm(half_centre_with_neighbour(dt, scheme, 16.0) - exact) for dt in (0.5, 0.25, 0.125)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(orders, order, atol=0.15)


def test_one_input_for_all_copies_and_none_for_no_current():
    network = Network()
    network.add_neuron("a", Neuron(capacitance_nF=2.0))
    network.add_neuron("b", Neuron(capacitance_nF=4.0))
    network.add_input("both", ["a", "b"])
    network.add_output("out", "b")
    stepper = network.compile(1.0, n_worms=3)
    state = stepper.initial_state()
    stepper.advance(state, np.array([8.0]))
    np.testing.assert_allclose(state.potential, [[4.0, 2.0]] * 3)
    np.testing.assert_allclose(stepper.outputs(state), [[2.0]] * 3)
    stepper.advance(state)
    np.testing.assert_allclose(state.potential, [[2.0, 1.5]] * 3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"scheme": "eular"}, "did you mean 'euler'"),
        ({"timestep_ms": 0.0}, "timestep_ms"),
        ({"n_worms": 0}, "n_worms"),
    ],
)
def test_impossible_steppers_are_refused(arguments, message):
    network = Network()
    network.add_neuron("a", Neuron())
    with pytest.raises(ConfigError, match=message):
        network.compile(**arguments)


def test_unknown_gate_start_is_refused():
    network = Network()
    network.add_neuron("a", Neuron())
    with pytest.raises(ConfigError, match="did you mean 'steady'"):
        network.compile().initial_state("stedy")  # type: ignore[arg-type]
