"""A worm cheap enough for tests of environments: three segments of six strands, one element a side."""

from __future__ import annotations

from typing import Any

import numpy as np

CHEAP: dict[str, Any] = {
    "preset": "riddle2025-muscles",
    "changes": {
        "body.mesh.n_segments": 3,
        "body.mesh.n_helices": 6,
        "body.rings.peak_force_N": 16.0,
        "clock.physics_timestep_s": 0.04,
    },
}
"""What `gymnasium.make` is given."""


def same(first: Any, second: Any) -> bool:
    """Tells whether two values are the same to the last bit, whatever they are nested in."""
    if isinstance(first, dict):
        return first.keys() == second.keys() and all(same(first[key], second[key]) for key in first)
    if isinstance(first, list | tuple):
        return len(first) == len(second) and all(map(same, first, second))
    if first is None or isinstance(first, str):
        return first == second
    first, second = np.asarray(first), np.asarray(second)
    if first.dtype != second.dtype or first.shape != second.shape:
        return False
    if first.dtype == object:
        return all(same(one, other) for one, other in zip(first.ravel(), second.ravel(), strict=True))
    return first.tobytes() == second.tobytes()
