"""The forces that the ring muscles bring to bear while they contract, and their work."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from annelid.analysis.rhythm import CONTRACTED

if TYPE_CHECKING:
    import xarray as xr


def contraction_forces(force_N: ArrayLike, activation: ArrayLike) -> NDArray[np.float64]:
    """Picks the muscle forces of all samples in which the muscle's own activation is above one half.

    No sample is left out: the short transient at each onset, above the force that the muscle settles at,
    is in there. It sets the peak and hardly moves the median. A force is that of a whole physics step, so what is
    shorter than a step, or between two samples, is not in the peak.

    Args:
        force_N: Muscle forces, N, positive when pulling, shape ``(n_times, n_muscles)``.
        activation: Their activations, in [0, 1], same shape.

    Returns:
        The forces, N, in one flat array; empty if no muscle ever contracts.
    """
    force = np.asarray(force_N, dtype=float)
    return force[np.asarray(activation, dtype=float) > CONTRACTED]


def net_work(data: xr.Dataset) -> NDArray[np.float64] | None:
    """Returns the work of every muscle on the body from a run's first sample to its last, J, ``(n_muscles,)``.

    What a muscle takes up while it is lengthened is subtracted. A worm that sums no work has force over shortening,
    by the trapezoidal rule; None without forces or lengths.
    """
    if not data.sizes.get("time"):
        return None
    if "muscle_work" in data:
        return _gain(data, "muscle_work")
    steps = _work_between_samples(data)
    return None if steps is None else steps.sum(axis=0)


def positive_work(data: xr.Dataset) -> NDArray[np.float64] | None:
    """Returns the work of every muscle while it was positive, J, ``(n_muscles,)``: nothing is regained.

    A run file of an earlier version lacks the sum over physics steps; then positive changes of the recorded work from
    sample to sample are added, which is less by what changes sign between two samples.
    """
    if not data.sizes.get("time"):
        return None
    if "positive_work" in data:
        return _gain(data, "positive_work")
    steps = np.diff(data["muscle_work"].values, axis=0) if "muscle_work" in data else _work_between_samples(data)
    return None if steps is None else steps.clip(0.0).sum(axis=0)


def _gain(data: xr.Dataset, name: str) -> NDArray[np.float64]:
    values = data[name].values
    return values[-1] - values[0]


def _work_between_samples(data: xr.Dataset) -> NDArray[np.float64] | None:
    if "muscle_force" not in data or "ring_length" not in data:
        return None
    force, length = data["muscle_force"].values, data["ring_length"].values
    return -0.5 * (force[1:] + force[:-1]) * np.diff(length, axis=0)
