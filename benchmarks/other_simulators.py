"""Networks as LEMS in pyLEMS and, where Java and pyNeuroML are installed, in jNeuroML, beside annelid's own steps.

Prints the numbers of docs/data_out.md: the largest difference of any potential of any neuron at any step, under
constant currents and Euler steps of the same length. Takes six minutes on one core.

    python benchmarks/other_simulators.py --csv docs/results/lems.csv
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from firmware import WORMS, random_network

import annelid
from annelid.nervous import Network
from annelid.output import write_csv
from annelid_lab.firmware import controller_circuit
from annelid_lab.lems import lems_text

PYLEMS = [sys.executable, "-c", "from lems.run import main; main()", "-nogui", "network.xml"], 1
"""How it is started, and how many steps come before the first row that it writes."""
RANDOM = 30


def jneuroml() -> tuple[list[str], int] | None:
    """How jNeuroML is started, None where it is not installed."""
    spec = find_spec("pyneuroml")
    if spec is None or spec.origin is None or shutil.which("java") is None:
        return None
    jars = sorted((Path(spec.origin).parent / "lib").glob("jNeuroML*.jar"))
    return (["java", "-Djava.awt.headless=true", "-jar", str(jars[-1]), "network.xml", "-nogui"], 0) if jars else None


def currents_of(network: Network) -> dict[str, float]:
    """Currents under which a network is compared, nA: none in those of worms, which have a rhythm of their own."""
    rng = np.random.default_rng(1)
    return {
        name: float(rng.uniform(0.0, 20.0)) if network.name.startswith("random") else 0.0 for name in network.inputs
    }


def potentials_mV(network: Network, timestep_ms: float, duration_ms: float) -> Any:
    """Potentials by annelid's own steps, mV, ``(n_steps + 1, n_neurons)``."""
    currents = list(currents_of(network).values())
    return network.compile(timestep_ms).run(np.tile(currents, (round(duration_ms / timestep_ms), 1)))[:, 0]


def difference_mV(
    network: Network, simulator: tuple[list[str], int], folder: Path, timestep_ms: float, duration_ms: float
) -> float:
    """Largest difference of a potential in another simulator, mV; inf if it ends in an error or writes no numbers."""
    written = folder / "potentials.dat"
    written.unlink(missing_ok=True)
    text = lems_text(network, currents_of(network), timestep_ms=timestep_ms, duration_ms=duration_ms)
    (folder / "network.xml").write_text(text, encoding="utf-8")
    command, first = simulator
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=900, check=False)
    if done.returncode or not written.exists():
        print(done.stdout[:2000], done.stderr[-2000:], file=sys.stderr)
        return np.inf
    theirs = 1e3 * np.loadtxt(written)[:, 1:]
    ours = potentials_mV(network, timestep_ms, duration_ms)[first:]
    # The last row may be there or not, as the simulator's sum of steps rounds.
    rows = min(len(ours), len(theirs))
    return float(np.abs(theirs[:rows] - ours[:rows]).max()) if rows >= len(ours) - 1 else np.inf


def groups() -> Iterator[tuple[str, list[Network], float, float]]:
    """Name, networks, step and duration, ms, of every row."""
    for name, changes in WORMS.items():
        config = annelid.load_config("riddle2023-rods", changes)
        controller: Any = annelid.build_controller(config, annelid.build_plant(config))
        yield name, [controller_circuit(controller).network], 0.5, 5000.0
    networks = [random_network(seed) for seed in range(RANDOM)]
    yield "random", networks, 0.05, 200.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--csv", type=Path, help="file to write")
    chosen = parser.parse_args()
    simulators = {"pylems": PYLEMS, "jneuroml": jneuroml()}
    rows: list[dict[str, Any]] = []
    with TemporaryDirectory() as folder:
        for name, networks, timestep_ms, duration_ms in groups():
            row: dict[str, Any] = {"name": name, "networks": len(networks)}
            row |= {"timestep_ms": timestep_ms, "duration_ms": duration_ms}
            ranges = [np.ptp(potentials_mV(each, timestep_ms, duration_ms), axis=0).max() for each in networks]
            row["range_mV"] = float(min(ranges))
            for name_of, simulator in simulators.items():
                found = [
                    difference_mV(network, simulator, Path(folder), timestep_ms, duration_ms)
                    for network in networks
                    if simulator is not None
                ]
                row[f"{name_of}_mV"], row[f"{name_of}_median_mV"] = (
                    (max(found), float(np.median(found))) if found else (None, None)
                )
            print("  ".join(f"{key} {value}" for key, value in row.items()), flush=True)
            rows.append(row)
    if chosen.csv is not None:
        write_csv(chosen.csv, rows[0], (row.values() for row in rows))


if __name__ == "__main__":
    main()
