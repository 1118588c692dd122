"""Firmware compiled on this machine, as a controller: to try it in closed loop before it is flashed."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

from annelid.control import SENSED
from annelid.errors import MissingDependency
from annelid.protocols import Array, Sensation
from annelid_lab.firmware.files import Firmware

OPTIONS = "-std=c99 -Wall -Wextra -Werror -pedantic -O2 -ffp-contract=off -shared -fPIC"


class HostFirmware:
    """A shared library of a firmware, with the methods of a controller; only one at a time is in its static memory.

    Attributes:
        name: For the run file.
        sensors: What a step is given, arrays to write to by the names of the fields.
        given: The same, one array.
        returned: What the latest step returned.
        potential_mV: Potentials, as they are in the library's memory.

    Raises:
        MissingDependency: There is no C compiler, ``cc``.
        RunFileError: A file cannot be written.
    """

    def __init__(self, firmware: Firmware, folder: str | Path) -> None:
        """Writes and compiles the firmware in a new folder within ``folder``."""
        if shutil.which("cc") is None:
            raise MissingDependency("compiling firmware needs a C compiler called cc: install gcc or clang")
        # A library of the same path would not be loaded again.
        made = Path(mkdtemp(dir=folder))
        _, source, _ = firmware.write(made)
        library = made / f"{firmware.name}.so"
        subprocess.run(["cc", *OPTIONS.split(), "-o", str(library), str(source), "-lm"], check=True)
        self.name, code = f"{firmware.name} in C", ctypes.CDLL(str(library))
        real = ctypes.c_double if firmware.real == "double" else ctypes.c_float
        self.given = np.zeros(sum(int(np.prod(shape)) for shape in firmware.sensors.values()), real)
        self.sensors: dict[str, Array] = {}
        start = 0
        for name, shape in firmware.sensors.items():
            end = start + int(np.prod(shape))
            self.sensors[name], start = self.given[start:end].reshape(shape), end
        self.returned = np.zeros(firmware.returned[1], real)
        state = (real * len(firmware.neurons)).in_dll(code, f"{firmware.name}_now")
        self.potential_mV = np.ctypeslib.as_array(state)
        self._init, self._step = getattr(code, f"{firmware.name}_init"), getattr(code, f"{firmware.name}_step")
        self._step.argtypes, self._step.restype = [ctypes.c_void_p, ctypes.c_void_p], None
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Returns to the initial state."""
        self._init()

    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step, as `annelid.protocols.Controller.step`."""
        for name, values in self.sensors.items():
            values[...] = SENSED[name].read(sensation)
        self.advance()
        return self.returned.astype(np.float64)

    def advance(self, n_steps: int = 1) -> None:
        """Advances by steps under what ``sensors`` holds."""
        for _ in range(n_steps):
            self._step(self.given.ctypes.data, self.returned.ctypes.data)
