"""What a crawl loses to friction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from annelid.analysis.gait import cycle_marks
from annelid.analysis.travel import way_ahead

if TYPE_CHECKING:
    from annelid.simulation.runfile import Run


@dataclass(frozen=True, slots=True)
class SlipCost:
    """Speed and loss over whole cycles, from the second contraction of segment 1 to its last.

    Attributes:
        cycles: Number of whole cycles.
        period_s: Mean duration of a cycle, s.
        speed_m_per_s: Way of the centre of mass towards where the worm leads at first, over time, m/s.
        loss_W: Work lost to friction over time, W.
        loss_J_per_m: The same over the way, J/m; infinite for a worm that got nowhere or backwards.
    """

    cycles: int
    period_s: float
    speed_m_per_s: float
    loss_W: float
    loss_J_per_m: float


def slip_cost(run: Run) -> SlipCost | None:
    """Reads what a run lost to friction.

    Args:
        run: A run that recorded ``slip_loss``.

    Returns:
        The record; None where segment 1 contracts fewer than three times.
    """
    data, marks = run.data, cycle_marks(run)
    if len(marks) < 2:
        return None
    time = data["time"].values
    first, last = np.searchsorted(time, marks[[0, -1]])
    duration = float(time[last] - time[first])
    ahead = way_ahead(run)
    way = float(ahead[last] - ahead[first])
    loss = data["slip_loss"].values.sum(axis=1)
    lost = float(loss[last] - loss[first])
    cycles = len(marks) - 1
    return SlipCost(
        cycles=cycles,
        period_s=duration / cycles,
        speed_m_per_s=way / duration,
        loss_W=lost / duration,
        loss_J_per_m=lost / way if way > 0.0 else float("inf"),
    )
