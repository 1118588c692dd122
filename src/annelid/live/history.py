"""What a view remembers of a worm: its postures, and the signals of its nervous system."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from operator import attrgetter, itemgetter

import numpy as np
from numpy.typing import NDArray

from annelid.draw.scene import postures_of
from annelid.simulation.runfile import Run

MOST_MOMENTS = 18_000
"""A live view forgets the oldest beyond these: ten minutes of thirty a second."""
_LOT = 1000
_time_of = attrgetter("time_s")


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """A worm at one instant."""

    time_s: float
    qpos: NDArray[np.floating]  # generalised positions, (nq,), or the outlines of a planar body, m
    activation: NDArray[np.floating]  # of every ring muscle, in [0, 1], (n_muscles,)
    contact_force_N: NDArray[np.floating]  # of the ground on every segment, (n_segments, 3)


class History:
    """Moments in the order of time, and samples of signals between them; the oldest are dropped.

    The signals are named after neurons (mV), then ``activation_1`` .. of the muscles.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self._moments: list[Moment] = []
        self._samples: list[tuple[float, NDArray[np.floating]]] = []

    @property
    def span_s(self) -> tuple[float, float]:
        """Times of the first and the last moment kept, s."""
        return self._moments[0].time_s, self._moments[-1].time_s

    def add(self, moment: Moment) -> None:
        """Adds a moment later than all others."""
        self._moments.append(moment)
        # In lots, since a list moves all that is behind.
        if len(self._moments) > MOST_MOMENTS + _LOT:
            del self._moments[:_LOT]
            del self._samples[: bisect_left(self._samples, self._moments[0].time_s, key=itemgetter(0))]

    def add_sample(self, time_s: float, values: NDArray[np.floating]) -> None:
        """Adds the signals of an instant later than all others, ``(n_signals,)``."""
        self._samples.append((time_s, values))

    def at(self, time_s: float) -> Moment:
        """Returns the last moment that is not after a time, or the first one."""
        return self._moments[max(0, bisect_right(self._moments, time_s + 1e-9, key=_time_of) - 1)]

    def window(self, first_s: float, last_s: float, most: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Returns times, s, ``(n,)``, and signals, ``(n, n_signals)``, of a stretch of time, evenly thinned."""
        start = bisect_left(self._samples, first_s, key=itemgetter(0))
        stop = bisect_right(self._samples, last_s + 1e-9, key=itemgetter(0))
        every = max(1, -(-(stop - start) // most))
        # On the same samples from one call to the next, or the curves would shimmer.
        taken = self._samples[start + -start % every : stop : every]
        values = np.array([sample for _, sample in taken], dtype=np.float64).reshape(-1, len(self.names))
        return np.array([time for time, _ in taken]), values


def signal_names(neurons: Iterable[str], n_muscles: int) -> tuple[str, ...]:
    """Returns the names of a history's signals."""
    return (*neurons, *(f"activation_{muscle + 1}" for muscle in range(n_muscles)))


def history_of(run: Run, n_coordinates: int | None) -> History:
    """Returns the moments and signals that a run has recorded, of a 3D worm of so many coordinates or a planar body."""
    data = run.data
    if n_coordinates is None:
        recorded = {str(name): signal.values for name, signal in data.items()}
        postures, moments = run.config.body.outlines(recorded), data["time"].values
    else:
        postures, moments = postures_of(run, n_coordinates), data["frame_time"].values
    neurons = [str(name) for name in data["neuron"].values] if "potential" in data else []
    activation = data["activation"].values
    history = History(signal_names(neurons, activation.shape[1]))
    times = data["time"].values
    signals = np.concatenate([data["potential"].values, activation], axis=1) if neurons else activation
    for time, values in zip(times, signals, strict=True):
        history.add_sample(float(time), values)
    sample = np.clip(np.searchsorted(times, moments + 1e-9, side="right") - 1, 0, None)
    nothing = np.zeros((len(times), data.sizes["segment"], 3))
    force = data["contact_force"].values if "contact_force" in data else nothing
    for number, time in enumerate(moments):
        history.add(Moment(float(time), postures[number], activation[sample[number]], force[sample[number]]))
    return history
