"""Speed, cost of transport and slip of a run over its whole cycles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from annelid.analysis.rhythm import contractions, segment_activation
from annelid.simulation.runfile import Run


@dataclass(frozen=True, slots=True)
class GaitNumbers:
    """A gait's numbers over whole cycles.

    Attributes:
        cycles: Number of whole cycles after the start.
        period_s: Their mean length, s.
        speed_m_per_s: Speed of the centre of mass, forwards, m/s.
        body_lengths_per_s: The same over the body's length at rest.
        cost_of_transport: Force times half the change of the rings' lengths over weight times way.
        stride_m: Way of a cycle, m.
        slip_ratio: Way that segments slip on the ground, on average, over the way of the centre of mass.
    """

    cycles: int
    period_s: float
    speed_m_per_s: float
    body_lengths_per_s: float
    cost_of_transport: float | None
    stride_m: float
    slip_ratio: float | None


def gait_numbers(run: Run) -> GaitNumbers | None:
    """Reads a run; None where it has no whole cycle."""
    data = run.data
    times = data["time"].values
    activation = segment_activation(data["activation"].values, run.config.body.n_segments)
    onsets = contractions(times, activation[:, 0], shortest_s=0.02)[:, 0]
    onsets = onsets[onsets > times[0] + 0.1]
    if len(onsets) < 2:
        return None
    a, b = np.searchsorted(times, [onsets[0], onsets[-1]])
    x = data["center_of_mass"].values[:, 0]
    way = float(x[a] - x[b])
    speed = way / float(times[b] - times[a])
    force, length = data["muscle_force"].values, data["ring_length"].values
    work = float(np.abs(force[a + 1 : b + 1] * 0.5 * np.diff(length[a : b + 1], axis=0)).sum())
    weight = float(data.attrs["total_mass_kg"]) * 9.81
    return GaitNumbers(
        cycles=len(onsets) - 1,
        period_s=float(np.diff(onsets).mean()),
        speed_m_per_s=speed,
        body_lengths_per_s=speed / float(data.attrs["body_length_m"]),
        cost_of_transport=work / (weight * abs(way)) if way else None,
        stride_m=speed * float(np.diff(onsets).mean()),
        slip_ratio=_slip(data, a, b) / abs(way) if way else None,
    )


def _slip(data, a, b):
    slip = data["slip_distance"].values
    return float((slip[b] - slip[a]).mean())
