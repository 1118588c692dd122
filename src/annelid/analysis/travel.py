"""How far the worm gets."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def net_travel(position_m: ArrayLike) -> float:
    """Displacement from the first to the last sample, m; negative backwards; NaN without samples."""
    position = np.asarray(position_m, dtype=float)
    return float(position[-1] - position[0]) if position.size else float("nan")


def path_travel(position_m: ArrayLike) -> float:
    """Length of the way forth and back, m: the sum of all displacements' sizes; NaN without samples."""
    position = np.asarray(position_m, dtype=float)
    return float(np.abs(np.diff(position)).sum()) if position.size else float("nan")
