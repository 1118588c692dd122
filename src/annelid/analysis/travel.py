"""How far the worm gets."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from annelid.body.worm import WormBody
from annelid.morphology import heading_turn
from annelid.protocols import Array

if TYPE_CHECKING:
    from annelid.simulation.runfile import Run

# Where a worm leads in its own axes, seen from above.
_FORWARDS = np.array([-1.0, 0.0])


def first_heading(run: Run) -> Array:
    """Returns the direction in which a run's worm leads at the start, seen from above, ``(2,)``."""
    body = run.config.body
    heading_deg = body.heading_deg if isinstance(body, WormBody) else 0.0
    return heading_turn(heading_deg)[:2, :2] @ _FORWARDS if heading_deg else _FORWARDS


def forward_position(run: Run) -> Array:
    """Returns how far the centre of mass is where the worm leads at the start, m from the origin, ``(n_times,)``."""
    ahead, centre = first_heading(run), run.data["center_of_mass"]
    along: Array = ahead[0] * centre.sel(axis="x").values
    # A planar worm moves along x alone.
    return along + ahead[1] * centre.sel(axis="y").values if ahead[1] else along


def net_travel(position_m: ArrayLike) -> float:
    """Displacement from the first to the last sample, m; negative backwards; NaN without samples."""
    position = np.asarray(position_m, dtype=float)
    return float(position[-1] - position[0]) if position.size else float("nan")


def path_travel(position_m: ArrayLike) -> float:
    """Length of the way forth and back, m: the sum of all displacements' sizes; NaN without samples."""
    position = np.asarray(position_m, dtype=float)
    return float(np.abs(np.diff(position)).sum()) if position.size else float("nan")
