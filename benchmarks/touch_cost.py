"""What touch and slip cost of a movement of the body, for some presets: ``python benchmarks/touch_cost.py``.

One ring contracts. Processor time is counted, which hardly depends on what else runs: means over a hundred movements.
"""

from __future__ import annotations

from time import process_time
from typing import Any
from unittest.mock import patch

import numpy as np

from annelid import load_config
from annelid.simulation.skin import Skin
from annelid.simulation.worm import WormPlant

PRESETS = ("riddle2023-rods", "riddle2023", "riddle2025-muscles")
MOVEMENTS = 100


def main() -> None:
    felt, spent = Skin.touch, list[float]()

    def timed(*arguments: Any) -> Any:
        began = process_time()
        result = felt(*arguments)
        spent.append(process_time() - began)
        return result

    for preset in PRESETS:
        plant = WormPlant(load_config(preset))
        plant.reset(0)
        pull = np.eye(plant.n_muscles)[:1].repeat(plant.steps_to_move(), axis=0)
        spent.clear()
        began = process_time()
        with patch.object(Skin, "touch", timed):
            for _ in range(MOVEMENTS):
                plant.stride(pull)
        whole = (process_time() - began) / MOVEMENTS
        own = sum(spent) / MOVEMENTS
        print(f"{preset:20} {1e3 * whole:6.2f} ms a movement, touch and slip {1e6 * own:4.0f} us: {own / whole:.1%}")


if __name__ == "__main__":
    main()
