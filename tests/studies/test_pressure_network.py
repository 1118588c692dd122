"""The peristalsis network with pressure feedback: what each of its synapses does, and nothing else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from annelid import load_config
from annelid.errors import ConfigError
from annelid.nervous import PeristalsisParameters, peristalsis_network
from annelid.protocols import Array
from annelid_studies.pressure import pressure_network

N = 4
PAPER = PeristalsisParameters()
CHOSEN: dict[str, Any] = {"hold": 1.0, "release": 1.8, "exchange": 0.8}
ALONE: dict[str, Any] = {"hold": 0.0, "release": 0.0, "exchange": 0.0, "pressure_ms": 5.0}
"""No synapse of ours, and quick neurons."""
REST, STRETCHED, EXTENDED = (20.0, 0.0), (0.0, 0.0), (0.0, 20.0)
"""Currents of stretch sensor and extension neuron at rest length, beyond the tolerance and at full length, nA."""


def sensory(load_nA: Array, lengths: list[tuple[float, float]], n_steps: int, **design: Any) -> Array:
    """Potentials of the sensory neurons after steps of 1 ms under the same currents, mV."""
    network, of_inputs = pressure_network(N, PAPER, **(CHOSEN | design)), dict[str, float]()
    for segment, (stretch, length) in enumerate(lengths, start=1):
        of_inputs |= {f"stretch_{segment}": stretch, f"length_{segment}": length}
        of_inputs[f"load_{segment}"] = load_nA[segment - 1]
    inputs = np.tile([of_inputs.get(name, 0.0) for name in network.inputs], (n_steps, 1))
    names = list(network.neurons)
    return network.compile().run(inputs)[-1, 0, [names.index(f"sensory_{segment}") for segment in range(1, N + 1)]]


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_a_stretched_segment_holds_only_as_far_as_it_bears_load(share: float) -> None:
    """Segment 2, while segment 1 is contracted and so sends no relay; the synapse is exact at no and full pressure."""
    hold, load = 0.4, np.array([0.0, 20.0 * share, 0.0, 0.0])
    reached = sensory(load, [STRETCHED] * N, 40, **(ALONE | {"hold": hold}))
    assert reached[1] == pytest.approx(share * hold * 20.0, abs=0.3)


@pytest.mark.parametrize("exchange", [0.0, 0.5, 0.9])
def test_a_contracting_segment_ends_the_contraction_two_segments_before(exchange: float) -> None:
    """Segment 1 contracts at the start; segment 2, at rest length, sends no relay to segment 3, two before it."""
    reached = sensory(np.zeros(N), [STRETCHED, REST, STRETCHED, STRETCHED], 40, **(ALONE | {"exchange": exchange}))
    assert reached[2] == pytest.approx(exchange * 20.0, abs=0.3)


@pytest.mark.parametrize("load_nA", [0.0, 10.8])
def test_an_extended_segment_lets_the_next_one_go_loaded_or_not(load_nA: float) -> None:
    reached = sensory(np.full(N, load_nA), [REST, EXTENDED, REST, REST], 500)
    assert reached[2] <= 0.0, "segment 3 follows segment 2"
    assert np.all(reached[[0, 3]] > 19.0)
    assert sensory(np.full(N, load_nA), [REST, REST, REST, EXTENDED], 500)[0] <= 0.0, "segment 1 follows the last"


def test_without_conductances_it_is_the_papers_network() -> None:
    assert pressure_network(N, PAPER, **ALONE).connections == peristalsis_network(N).connections
    # Of three segments two before would be the next one.
    assert pressure_network(3, PAPER, **(ALONE | {"exchange": 0.8})).connections == peristalsis_network(3).connections


def test_what_does_not_fit_is_refused(subtests: pytest.Subtests) -> None:
    for changes, words in (
        ({"controller": {"kind": "sns-pressure"}}, "needs the touch of a skin"),
        ({"controller": {"kind": "sns-pressure", "hold": -1.0}}, "hold = -1.0: must be at least 0"),
    ):
        with subtests.test(words), pytest.raises(ConfigError, match=words):
            load_config("riddle2022-planar", changes)
