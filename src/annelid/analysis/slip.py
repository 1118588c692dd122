"""What a crawl loses to friction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from annelid.analysis.gait import cycle_marks
from annelid.analysis.travel import forward_position

if TYPE_CHECKING:
    from annelid.simulation.runfile import Run


@dataclass(frozen=True, slots=True)
class SlipCost:
    """Speed and loss over complete cycles, from the second contraction of segment 1 to its last.

    Attributes:
        cycles: Number of complete cycles.
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
    """Reads what a run that recorded ``slip_loss`` lost to friction; None for fewer than three contractions."""
    marks = cycle_marks(run)
    if len(marks) < 2:
        return None
    ends = np.searchsorted(run.data["time"].values, marks[[0, -1]])
    loss = run.data["slip_loss"].values.sum(axis=1)
    duration, way, lost = (
        float(np.diff(each[ends])[0]) for each in (run.data["time"].values, forward_position(run), loss)
    )
    cycles = len(marks) - 1
    return SlipCost(cycles, duration / cycles, way / duration, lost / duration, lost / way if way > 0.0 else np.inf)
