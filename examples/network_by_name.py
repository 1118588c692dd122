"""A nervous system of your own, built by name: six neurons that silence each other hand the wave on by stretch.

    python examples/network_by_name.py [folder]

Writes run.nc and network.svg. Takes a few seconds.
"""

from __future__ import annotations

import sys
from itertools import permutations
from pathlib import Path
from tempfile import TemporaryDirectory

import annelid
from annelid.analysis import rhythm_score
from annelid.control import NetworkController, Sense
from annelid.draw import network_figure
from annelid.nervous import Network, Neuron, Synapse

RANGE_mV, GAIN_nA_per_m = 20.0, 400.0


def baton(n_segments: int) -> Network:
    """Builds it: all neurons are awake, the one that is up keeps the others down until stretch helps its successor."""
    network = Network("baton")
    names = [f"segment{number}" for number in range(1, n_segments + 1)]
    for name in names:
        awake = Neuron(capacitance_nF=100.0, bias_nA=RANGE_mV)
        network.add_neuron(name, awake, initial_mV=RANGE_mV if name == names[0] else 0.0)
        network.add_output(name, name)
    for source, target in permutations(names, 2):
        network.add_synapse(source, target, Synapse(conductance_uS=0.6, reversal_mV=-40.0))
    for name, successor in zip(names, names[1:] + names[:1], strict=True):
        network.add_input(f"stretch of {name}", successor)
    return network


def main(folder: Path, duration_s: float = 4.0) -> None:
    """Lets the network drive the worm and scores the rhythm."""
    network = baton(6)
    stretch = {name: Sense("lengthening_m", place, gain=GAIN_nA_per_m) for place, name in enumerate(network.inputs)}
    drive = NetworkController(network, stretch, outputs=list(network.outputs), to_mV=RANGE_mV)
    config = annelid.load_config("riddle2025-muscles", {"duration_s": duration_s})
    score = rhythm_score(annelid.simulate(config, folder, controller=drive))
    print(f"{score.verdict or 'too short'}: {score.reason}")
    print(network_figure(network, folder / "network.svg"))


if __name__ == "__main__":
    with TemporaryDirectory() as temporary:
        main(Path(sys.argv[1] if len(sys.argv) > 1 else temporary))
