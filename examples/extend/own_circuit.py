"""A controller of your own in one file, declared once: numpy drives the worm by it, and it is written as C99.

    python examples/extend/own_circuit.py runs/baton

One neuron for each segment keeps itself active, until the stretch of its segment excites the next one.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Literal

from pydantic import Field

import annelid
from annelid.config import Positive
from annelid.control import Circuit, CircuitKind, Readout, Sense
from annelid.nervous import Network, Neuron, Synapse
from annelid_lab.firmware import controller_firmware

if TYPE_CHECKING:
    from annelid.config import RunConfig


class Baton(CircuitKind):
    """Neurons that take turns: each inhibits all others, and stretch passes the activity on."""

    kind: Literal["baton"] = "baton"
    gain_nA_per_m: Positive = Field(default=400.0, description="current per lengthening of the segment before")

    def circuit(self, config: RunConfig, n_segments: int) -> Circuit:
        """Returns the circuit: its network, what its inputs sense, and which outputs drive the muscles."""
        network, names = Network("baton"), [f"segment{number}" for number in range(1, n_segments + 1)]
        for name in names:
            network.add_neuron(name, Neuron(100.0, bias_nA=20.0), initial_mV=20.0 if name == names[0] else 0.0)
            network.add_input(f"stretch before {name}", name)
            network.add_output(name, name)
        for source in names:
            for target in names:
                if source != target:
                    network.add_synapse(source, target, Synapse(0.6, -40.0))
        senses = {
            f"stretch before {name}": Sense("lengthening_m", (place - 1) % n_segments, gain=self.gain_nA_per_m)
            for place, name in enumerate(names)
        }
        return Circuit(network, senses, Readout(names, to_mV=20.0), name="baton")


def main(folder: str) -> None:
    """Runs a worm, and writes its controller as C."""
    config = annelid.load_config("riddle2023-rods", {"controller": {"kind": "baton"}, "duration_s": 0.2})
    run = annelid.simulate(config, folder, progress=False)
    print(f"largest activation {run.data['activation'].values.max():.2f}")
    controller = annelid.build_controller(config, annelid.build_plant(config))
    for path in controller_firmware(controller, "baton").write(f"{folder}/firmware", overwrite=True):
        print(path)


if __name__ == "__main__":
    main(sys.argv[1])
