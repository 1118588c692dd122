"""The forces that the ring muscles bring to bear while they contract."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from annelid.analysis.rhythm import CONTRACTED


def contraction_forces(force_N: ArrayLike, activation: ArrayLike) -> NDArray[np.float64]:
    """Picks the muscle forces of all samples in which the muscle's own activation is above one half.

    No sample is left out: the short transient at each onset, above the force that the muscle settles at,
    is in there. It sets the peak and hardly moves the median.

    Args:
        force_N: Muscle forces, N, positive when pulling, shape ``(n_times, n_muscles)``.
        activation: Their activations, in [0, 1], same shape.

    Returns:
        The forces, N, in one flat array; empty if no muscle ever contracts.
    """
    force = np.asarray(force_N, dtype=float)
    return force[np.asarray(activation, dtype=float) > CONTRACTED]


def muscle_work(force_N: ArrayLike, length_m: ArrayLike) -> NDArray[np.float64]:
    """Integrates each muscle's force over its shortening, by the trapezoidal rule.

    Args:
        force_N: Muscle forces, N, positive when pulling, shape ``(n_times, n_muscles)``.
        length_m: Their lengths, m, same shape.

    Returns:
        The work that each has done on the body, J, shape ``(n_muscles,)``; what it took back is subtracted.
    """
    force, length = np.asarray(force_N, dtype=float), np.asarray(length_m, dtype=float)
    return -(0.5 * (force[1:] + force[:-1]) * np.diff(length, axis=0)).sum(axis=0)
