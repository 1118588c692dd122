"""The forces and the work of the ring muscles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from annelid.analysis.numbers import finite, finite_each, number
from annelid.analysis.rhythm import CONTRACTED
from annelid.protocols import Array
from annelid.simulation.runfile import Recorded


@dataclass(frozen=True, kw_only=True)
class Muscles:
    """Forces of the muscles in all samples in which they are contracted, and their work in the whole run."""

    contraction_force_median_N: float | None = number("median muscle force while contracted", "force", "N")
    contraction_force_peak_N: float | None = number("largest recorded muscle force while contracted", "peak force", "N")
    segment_force_median_N: list[float | None] | None = number(
        "median force of the segment's muscles while contracted", "force by segment", "N", per_segment=True
    )
    segment_force_peak_N: list[float | None] | None = number(
        "largest force of the segment's muscles while contracted", "peak by segment", "N", per_segment=True
    )
    positive_work_J: list[float | None] | None = number(
        "work of the segment's muscles while it was positive; none of it is regained",
        "positive work",
        "J",
        per_segment=True,
    )
    muscle_work_J: list[float | None] | None = number(
        "net work of the segment's muscles", "net work", "J", per_segment=True
    )


def muscles(data: Mapping[str, Recorded], n_segments: int) -> Muscles:
    """Reads forces and work from a run's signals.

    Args:
        data: The signals.
        n_segments: Segments, each with as many muscles as the next.
    """
    forces = _contraction_forces(data, n_segments)
    pulling = np.concatenate([np.empty(0), *forces])
    positive, net = muscle_work(data, positive=True), muscle_work(data)
    return Muscles(
        contraction_force_median_N=finite(np.median(pulling)) if pulling.size else None,
        contraction_force_peak_N=finite(pulling.max()) if pulling.size else None,
        segment_force_median_N=[finite(np.median(one)) if one.size else None for one in forces] or None,
        segment_force_peak_N=[finite(one.max()) if one.size else None for one in forces] or None,
        positive_work_J=None if positive is None else finite_each(positive.reshape(n_segments, -1).sum(axis=1)),
        muscle_work_J=None if net is None else finite_each(net.reshape(n_segments, -1).sum(axis=1)),
    )


def muscle_work(data: Mapping[str, Recorded], *, positive: bool = False) -> Array | None:
    """Returns the work of every muscle on the body from a run's first sample to its last, J, ``(n_muscles,)``.

    What a muscle takes up while it is lengthened is subtracted, or with ``positive`` not regained. Where no such sum is
    recorded, the changes from sample to sample are added; without work they are force over shortening, or None.
    """
    recorded, least_J = ("positive_work", 0.0) if positive else ("muscle_work", -np.inf)
    if not data["time"].values.size:
        return None
    if recorded in data:
        values = data[recorded].values
        return values[-1] - values[0]
    if "muscle_work" in data:
        steps = np.diff(data["muscle_work"].values, axis=0)
    elif "muscle_force" in data and "ring_length" in data:
        force, length = data["muscle_force"].values, data["ring_length"].values
        steps = -0.5 * (force[1:] + force[:-1]) * np.diff(length, axis=0)
    else:
        return None
    return steps.clip(least_J).sum(axis=0)


def cable_work(data: Mapping[str, Recorded]) -> float | None:
    """Adds force times half of every change of length, J; a sample's force acted during the step before it."""
    if "muscle_force" not in data or "ring_length" not in data:
        return None
    changes = np.abs(np.diff(data["ring_length"].values, axis=0))
    return float((data["muscle_force"].values[1:] * changes).sum() / 2)


def _contraction_forces(data: Mapping[str, Recorded], n_segments: int) -> list[Array]:
    """Forces of all samples in which the muscle itself is contracted, an array per segment; empty without forces.

    The short transient at each onset is in there: it sets the peak and hardly moves the median.
    """
    if "muscle_force" not in data or "activation" not in data:
        return []
    force, contracted = data["muscle_force"].values, data["activation"].values > CONTRACTED
    own = np.split(np.arange(force.shape[1]), n_segments)
    return [force[:, one][contracted[:, one]] for one in own]
