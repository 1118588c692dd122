"""Where the time of a step of the closed loop goes outside the body: network, recording, guards, the loop itself.

Run it on an otherwise idle machine: ``taskset -c 1 python benchmarks/loop_shares.py [preset]``. Every part is timed by
a stopwatch round its calls, which adds about a microsecond to each. Resident memory is read while the run goes on.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from time import perf_counter
from typing import Any
from unittest.mock import patch

from annelid import load_config, simulate
from annelid.control import SnsController
from annelid.simulation import loop
from annelid.simulation.coupling import Coupling
from annelid.simulation.recorder import Recorder
from annelid.simulation.watch import Watch
from annelid.simulation.worm import WormPlant

DURATION_S = 12.0
PARTS: dict[str, tuple[tuple[type, str], ...]] = {
    "body": ((WormPlant, "stride"),),
    "network and control": ((SnsController, "stride"), (Coupling, "check_activation")),
    "recording": (
        (WormPlant, "read"),
        (SnsController, "read"),
        (Recorder, "sample"),
        (Recorder, "frame"),
        (Recorder, "flush"),
        (Coupling, "checkpoint"),
    ),
    "guards": ((Coupling, "watch"),),
}
WITHIN: dict[str, tuple[tuple[type, str], ...]] = {
    "watch on shape": ((Watch, "look"),),
    "warnings": ((WormPlant, "doubts"),),
    "books of work": ((WormPlant, "book"),),
}
"""Parts of the parts: what watches the worm's shape, tells what is doubtful, and books force and work."""


def stopwatch(spent: list[float], method: Callable[..., Any]) -> Callable[..., Any]:
    """Wraps a method so that the time of every call is noted, s."""

    def timed(*arguments: Any) -> Any:
        began = perf_counter()
        result = method(*arguments)
        spent.append(perf_counter() - began)
        return result

    return timed


def resident_MB() -> float:
    """Memory of this process that lies in RAM, MB; NaN where the system does not say."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except OSError:
        return float("nan")
    return pages * 4096 / 1e6


def main(preset: str) -> None:
    config = load_config(preset, {"duration_s": DURATION_S})
    spent: dict[str, list[float]] = {part: [] for part in PARTS | WITHIN}
    whole: list[float] = []
    memory: list[float] = []
    with ExitStack() as stack, tempfile.TemporaryDirectory() as folder:
        for part, methods in (WITHIN | PARTS).items():
            for owner, name in methods:
                stack.enter_context(patch.object(owner, name, stopwatch(spent[part], getattr(owner, name))))
        stack.enter_context(patch.object(loop, "_run", stopwatch(whole, loop._run)))
        simulate(config, Path(folder) / "run", progress=lambda *_: memory.append(resident_MB()))
    steps = DURATION_S / config.clock.physics_timestep_s
    total = whole[0]
    parts = {part: sum(spent[part]) for part in PARTS}
    parts["loop"] = total - sum(parts.values())
    for part, seconds in parts.items():
        print(f"{part:20} {1e6 * seconds / steps:7.0f} us a step  {seconds / total:6.1%}")
    for part in WITHIN:
        seconds = sum(spent[part])
        print(f"{'  ' + part:24} {1e6 * seconds / steps:3.0f} us a step  {seconds / total:6.1%}, within the above")
    asked = parts["network and control"] + parts["recording"]
    print(f"{'network to recording':20} {1e6 * asked / steps:7.0f} us a step  {asked / total:6.1%}")
    print(f"resident memory from {min(memory):.0f} to {max(memory):.0f} MB while it runs")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "riddle2023-rods")
