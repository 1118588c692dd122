"""The loop of plant, controller and clock, and the run file it writes.

The 3D worm and the lock of a folder are loaded on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from annelid.lazy import lazy
from annelid.simulation.loop import simulate
from annelid.simulation.runfile import Run, open_run
from annelid.simulation.stepping import Simulation, build_controller, build_plant, start

if TYPE_CHECKING:
    from annelid.simulation.lock import locks
    from annelid.simulation.progress import ProgressCallback
    from annelid.simulation.recorder import Senses
    from annelid.simulation.worm import ENGINE_WARNINGS, STATE_PARTS, WormPlant, compile_worm

__all__ = [
    "ENGINE_WARNINGS",
    "STATE_PARTS",
    "ProgressCallback",
    "Run",
    "Senses",
    "Simulation",
    "WormPlant",
    "build_controller",
    "build_plant",
    "compile_worm",
    "locks",
    "open_run",
    "simulate",
    "start",
]

__getattr__, __dir__ = lazy(__name__)
