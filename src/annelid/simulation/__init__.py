"""The loop of plant, controller and clock, and the run file it writes."""

from __future__ import annotations

from annelid.simulation.loop import simulate
from annelid.simulation.runfile import Run, open_run
from annelid.simulation.stepping import build_controller, build_plant

__all__ = ["Run", "build_controller", "build_plant", "open_run", "simulate"]
