"""A controller as C, compiled on this machine, in closed loop with the simulated worm, beside the one in Python.

    python examples/firmware_in_the_loop.py [folder]

Needs a C compiler. Takes some ten seconds.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import annelid
from annelid_lab.firmware import HostFirmware, controller_firmware


def main(folder: Path, duration_s: float = 6.0) -> list[annelid.Run]:
    """Runs the worm with either controller, prints the numbers to compare, and returns the runs."""
    config = annelid.load_config("riddle2023-rods", {"duration_s": duration_s})
    python = annelid.build_controller(config, annelid.build_plant(config))
    firmware = HostFirmware(controller_firmware(python, config.name), folder)
    runs = []
    for name, controller in (("python", python), ("firmware", firmware)):
        runs.append(annelid.simulate(config, folder / name, controller=controller, progress=False))
        found = annelid.summary(runs[-1])
        print(f"{name}: order {found.order}, period {found.period_s} s, elongations {found.elongation_mean_max_m} m")
    return runs


if __name__ == "__main__":
    with TemporaryDirectory() as temporary:
        main(Path(sys.argv[1] if len(sys.argv) > 1 else temporary))
