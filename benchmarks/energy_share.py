"""What the energy books cost, as shares of a step's processor time.

python benchmarks/energy_share.py
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from rich.console import Console
from rich.table import Table

from annelid.config import load_config
from annelid.simulation.worm import WormPlant

PRESETS = ("riddle2023-rods", "riddle2025", "riddle2025-muscles")


def seconds(call: Callable[[], object], times: int) -> float:
    """Processor time of one call, s: the least of three series."""
    series = []
    for _ in range(3):
        start = time.process_time()
        for _ in range(times):
            call()
        series.append((time.process_time() - start) / times)
    return min(series)


def main() -> None:
    """Prints a row for every preset."""
    table = Table("preset", "a step", "books of a step", "elastic energy of a sample")
    for preset in PRESETS:
        config = load_config(preset)
        worm = WormPlant(config)
        worm.reset(0)
        per_step = max(1, round(config.clock.physics_timestep_s / config.clock.control_timestep_s))
        pull = np.resize([1.0, 0.0, 0.3], worm.n_muscles)
        for _ in range(30 * per_step):
            worm.step(pull)
        whole = seconds(lambda worm=worm, pull=pull, n=per_step: [worm.step(pull) for _ in range(n)], 30)
        keeper = worm.anatomy.energy_meter
        engine = {name: getattr(worm.data, name) for name in keeper.outputs}
        parts = (
            seconds(lambda keeper=keeper, engine=engine, pull=pull: keeper.step(engine, pull), 200),
            seconds(worm.elastic_energy_J, 200),
        )
        cells = [f"{1e6 * part:.0f} us ({100 * part / whole:.1f} %)" for part in parts]
        table.add_row(preset, f"{1e3 * whole:.2f} ms", *cells)
    Console().print(table)


if __name__ == "__main__":
    main()
