"""A controller as C, compiled on this machine, in closed loop with the simulated worm beside the controller in Python.

    python examples/firmware_in_the_loop.py [folder]

Needs a C compiler. Takes some twenty seconds.
"""

from __future__ import annotations

import ctypes
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import annelid
from annelid.export import Firmware, controller_firmware


class HostFirmware:
    """Firmware as a shared library, with the methods of a controller."""

    def __init__(self, firmware: Firmware, folder: Path) -> None:
        """Writes and compiles it in a folder."""
        library = folder / f"{firmware.name}.so"
        _, source, _ = firmware.write(folder, overwrite=True)
        options = [
            "-std=c99",
            "-Wall",
            "-Wextra",
            "-Werror",
            "-pedantic",
            "-O2",
            "-ffp-contract=off",
            "-shared",
            "-fPIC",
        ]
        subprocess.run(["cc", *options, "-o", str(library), str(source), "-lm"], check=True)
        self.name, self._code = f"{firmware.name} in C", ctypes.CDLL(str(library))
        real = ctypes.c_double if firmware.real == "double" else ctypes.c_float
        self.sensors = {name: np.zeros(shape, real) for name, shape in firmware.sensors.items()}
        self.returned = np.zeros(firmware.returned[1], real)
        state = (real * len(firmware.neurons)).in_dll(self._code, f"{firmware.name}_now")
        self.potential_mV = np.frombuffer(state, real)
        self._init, self._step = (getattr(self._code, f"{firmware.name}_{what}") for what in ("init", "step"))
        self._step.argtypes, self._step.restype = [ctypes.c_void_p, ctypes.c_void_p], None
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Returns to the initial state."""
        self._init()

    def step(self, sensation: annelid.Sensation) -> np.ndarray:
        """Advances by one control step."""
        for name, values in self.sensors.items():
            values[...] = Firmware.sensed(name, sensation)
        self.advance()
        return self.returned.astype(float)

    def advance(self, n_steps: int = 1) -> None:
        """Advances by steps under what ``sensors`` holds; see ``returned`` and ``potential_mV`` after it."""
        given = np.concatenate([values.ravel() for values in self.sensors.values()])
        for _ in range(n_steps):
            self._step(given.ctypes.data, self.returned.ctypes.data)


def main(folder: Path, duration_s: float = 6.0) -> None:
    """Runs the worm with both controllers and prints the numbers to compare."""
    config = annelid.load_config("riddle2023-rods", {"duration_s": duration_s})
    python = annelid.build_controller(config, annelid.build_plant(config))
    for number, controller in enumerate((python, HostFirmware(controller_firmware(python, config.name), folder))):
        run = annelid.simulate(config, folder / str(number), controller=controller, progress=False)
        found = annelid.summary(run)
        print(f"{controller.name}: order {found.order}, period {found.period_s} s")


if __name__ == "__main__":
    with TemporaryDirectory() as temporary:
        main(Path(sys.argv[1] if len(sys.argv) > 1 else temporary))
