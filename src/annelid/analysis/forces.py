"""The forces that the ring muscles bring to bear while they contract, and their work."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from annelid.analysis.rhythm import CONTRACTED
from annelid.protocols import Array

if TYPE_CHECKING:
    import xarray as xr


def contraction_forces(force_N: ArrayLike, activation: ArrayLike) -> Array:
    """Picks the muscle forces of all samples in which the muscle's own activation is above one half.

    The short transient at each onset, above the force that the muscle settles at, is in there. It sets the peak and
    hardly moves the median. What is shorter than a physics step, or between two samples, is not in the peak.

    Args:
        force_N: Muscle forces, N, positive when pulling, shape ``(n_times, n_muscles)``.
        activation: Their activations, in [0, 1], same shape.

    Returns:
        The forces, N, in one flat array; empty if no muscle ever contracts.
    """
    return np.asarray(force_N, dtype=float)[np.asarray(activation, dtype=float) > CONTRACTED]


def net_work(data: xr.Dataset) -> Array | None:
    """Returns the work of every muscle on the body from a run's first sample to its last, J, ``(n_muscles,)``.

    What a muscle takes up while it is lengthened is subtracted. A worm that sums no work has force over shortening,
    by the trapezoidal rule; None without forces or lengths.
    """
    return _work(data, "muscle_work", -np.inf)


def positive_work(data: xr.Dataset) -> Array | None:
    """Returns the work of every muscle while it was positive, J, ``(n_muscles,)``: nothing is regained.

    Where the sum over physics steps was not recorded, positive changes of the recorded work from sample to sample are
    added, which is less by what changes sign between two samples.
    """
    return _work(data, "positive_work", 0.0)


def _work(data: xr.Dataset, recorded: str, least_J: float) -> Array | None:
    """A recorded sum's gain; else the sum of the work between samples, none of which counts as less than the least."""
    if not data.sizes.get("time"):
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
