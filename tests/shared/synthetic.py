"""Run data with a known rhythm, known elongations and known forces, written down rather than simulated."""

from __future__ import annotations

import numpy as np
import xarray as xr

PEAKS_M = (0.040, 0.020, 0.030)
FIRST_HELIX_EXCESS = 1.25
REST_M = 0.075
HOLDING_FORCE_N = 2.0


def wave_activation(
    time_s: np.ndarray, n_segments: int, period_s: float, start_s: float = 0.0, rise_s: float = 0.02
) -> np.ndarray:
    """Segment after segment contracts for 1/N of the period; linear ramps cross 0.5 at the nominal onsets."""
    share_s = period_s / n_segments
    activation = np.zeros((len(time_s), n_segments))
    for k in range(int((time_s[-1] - start_s) / share_s) + 2):
        since = time_s - start_s - k * share_s
        pulse = np.minimum(0.5 + since / rise_s, 0.5 + (share_s - since) / rise_s)
        activation[:, k % n_segments] += np.clip(pulse, 0.0, 1.0)
    return activation


def wave_data(
    *, n_segments: int = 3, period_s: float = 2.4, duration_s: float = 6.0, interval_s: float = 0.005
) -> xr.Dataset:
    """The variables of a 3D worm's run file for a perfect wave of N segments.

    The mean of segment s's sensors rises by ``PEAKS_M[s]`` above rest, the first helix by
    ``FIRST_HELIX_EXCESS`` times that; the muscles hold ``HOLDING_FORCE_N``; the worm walks -1 cm/s.
    """
    time = np.arange(round(duration_s / interval_s) + 1) * interval_s
    activation = wave_activation(time, n_segments, period_s)
    peaks = np.array([PEAKS_M[i % 3] for i in range(n_segments)])
    weights = np.array([FIRST_HELIX_EXCESS, *[(6 - FIRST_HELIX_EXCESS) / 5] * 5])
    stretch = REST_M + (activation * peaks)[:, :, None] * weights
    potential = np.empty((len(time), 4 * n_segments))
    potential[:, 0::4], potential[:, 1::4] = 20 * activation, 20 * (1 - activation)
    potential[:, 2::4], potential[:, 3::4] = 20 * (activation < 0.5), 5.0
    kinds = ("contraction", "expansion", "sensory", "relay")
    centre = np.stack([-0.01 * time, 0 * time, 0.16 + 0 * time], axis=1)
    return xr.Dataset(
        {
            "potential": (("time", "neuron"), potential),
            "activation": (("time", "muscle"), activation),
            "stretch_length": (("time", "segment", "sensor"), stretch),
            "stretch_rest_length": (("segment", "sensor"), np.full((n_segments, 6), REST_M)),
            "ring_length": (("time", "muscle"), 0.96 - 0.6 * activation),
            "muscle_force": (("time", "muscle"), HOLDING_FORCE_N * (activation > 0.5)),
            "center_of_mass": (("time", "axis"), centre),
            "edge_strain": (("time",), 0.001 * activation.max(axis=1)),
            "pin_gap": (("time",), np.full(len(time), 0.002)),
            "wall_time": (("time",), 2.0 * time),
            "frame_time": (("frame",), np.empty(0)),
        },
        coords={
            "time": time,
            "segment": np.arange(1, n_segments + 1),
            "neuron": [f"{kind}_{i + 1}" for i in range(n_segments) for kind in kinds],
            "axis": ["x", "y", "z"],
        },
    )
