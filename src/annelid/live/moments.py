"""What the view remembers of a worm: its postures, and its signals for the plots; of a run, or as it goes on."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from annelid.draw.scene import postures_of
from annelid.simulation.runfile import Run

KEEP_BYTES = 200_000_000
"""A live view forgets the oldest postures beyond this."""
KEEP_S = 600.0
"""And the oldest of anything, in simulated time."""
_TRIM_EVERY = 64


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """A worm at one instant.

    Attributes:
        time_s: Simulated time, s.
        qpos: Generalised positions, ``(nq,)``.
        activation: Of every ring muscle, in [0, 1], ``(n_muscles,)``.
        contact_force_N: Force of the ground on every segment, N, ``(n_segments, 3)``.
    """

    time_s: float
    qpos: NDArray[np.floating]
    activation: NDArray[np.floating]
    contact_force_N: NDArray[np.floating]


class Reel:
    """Moments in the order of time, and samples of signals between them.

    Attributes:
        names: Names of the signals: neurons (mV), then ``activation_1`` .. of the muscles.
    """

    def __init__(self, names: Sequence[str]) -> None:
        """Makes an empty one."""
        self.names = tuple(names)
        self._moments: list[Moment] = []
        self._times: list[float] = []
        self._samples: list[NDArray[np.floating]] = []
        self._sample_times: list[float] = []

    @property
    def span_s(self) -> tuple[float, float]:
        """Times of the first and the last moment kept, s."""
        return self._times[0], self._times[-1]

    def add(self, moment: Moment) -> None:
        """Adds a moment later than all others."""
        self._moments.append(moment)
        self._times.append(moment.time_s)

    def add_sample(self, time_s: float, values: NDArray[np.floating]) -> None:
        """Adds the signals of an instant later than all others, ``(n_signals,)``."""
        self._samples.append(values)
        self._sample_times.append(time_s)

    def forget(self) -> None:
        """Drops the oldest moments and samples that there is no room for."""
        most = max(2, KEEP_BYTES // max(1, self._moments[-1].qpos.nbytes))
        excess = max(len(self._times) - most, bisect_left(self._times, self._times[-1] - KEEP_S))
        if excess >= _TRIM_EVERY:
            del self._moments[:excess], self._times[:excess]
            old = bisect_left(self._sample_times, self._times[0])
            del self._samples[:old], self._sample_times[:old]

    def at(self, time_s: float) -> Moment:
        """Returns the last moment that is not after a time, or the first one."""
        return self._moments[max(0, bisect_right(self._times, time_s + 1e-9) - 1)]

    def window(self, first_s: float, last_s: float, most: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Returns the signals of a stretch of time.

        Args:
            first_s: From here on, s.
            last_s: Up to here, s.
            most: Of more samples than this only every second, third .. is taken.

        Returns:
            Times, s, ``(n,)``, and signals, ``(n, n_signals)``.
        """
        start, stop = bisect_left(self._sample_times, first_s), bisect_right(self._sample_times, last_s + 1e-9)
        every = max(1, -(-(stop - start) // most))
        # On the same samples from one call to the next, or the curves would shimmer.
        start += -start % every
        values = np.array(self._samples[start:stop:every], dtype=np.float64).reshape(-1, len(self.names))
        return np.array(self._sample_times[start:stop:every]), values


def signal_names(neurons: Sequence[str], n_muscles: int) -> tuple[str, ...]:
    """Names of a reel's signals."""
    return (*neurons, *(f"activation_{muscle + 1}" for muscle in range(n_muscles)))


def reel_of(run: Run, n_coordinates: int) -> Reel:
    """Returns the moments and signals that a run has recorded.

    Args:
        run: The run of a 3D worm.
        n_coordinates: Generalised positions of the body that is built from its configuration.

    Raises:
        RunFileError: It has no postures, or those of another body.
    """
    data, qpos = run.data, postures_of(run, n_coordinates)
    neurons = [str(name) for name in data["neuron"].values] if "potential" in data else []
    activation = data["activation"].values
    reel = Reel(signal_names(neurons, activation.shape[1]))
    times = data["time"].values
    signals = np.concatenate([data["potential"].values, activation], axis=1) if neurons else activation
    for time, values in zip(times, signals, strict=True):
        reel.add_sample(float(time), values)
    frame_times = data["frame_time"].values
    sample = np.clip(np.searchsorted(times, frame_times + 1e-9, side="right") - 1, 0, None)
    force = data["contact_force"].values
    for frame, time in enumerate(frame_times):
        reel.add(Moment(float(time), qpos[frame], activation[sample[frame]], force[sample[frame]]))
    return reel
