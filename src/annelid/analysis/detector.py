"""A slip detector judged by the slip that the simulator knows of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from annelid.control.slip_detector import SlipDetector
from annelid.errors import RunFileError
from annelid.protocols import Array, Sensation

if TYPE_CHECKING:
    from annelid.simulation.runfile import Run

SLIPPING_M_PER_S = 0.05
"""A segment truly slips while what touches of it moves faster than this along the body, on average over the window."""
LEAST_LOAD_N = 1.0
"""A segment that bears less on average over the window does not slip: it is in the air, or about to be."""
WINDOW_S = 0.05
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Detection:
    """What slipped, and what a detector made of it.

    Attributes:
        time_s: Times of the samples, s, ``(n_times,)``.
        slips: Which segments truly slip, ``(n_times, n_segments)``.
        true_m_per_s: Their true speeds over the ground along the body, m/s, same shape.
        estimated_m_per_s: The detector's estimates, m/s, same shape.
        bears: Where the detector finds enough load for slip, same shape.
    """

    time_s: Array
    slips: Bools
    true_m_per_s: Array
    estimated_m_per_s: Array
    bears: Bools

    def alarms(self, limit_m_per_s: float) -> Bools:
        """Returns where the detector reports slip with this limit, ``(n_times, n_segments)``."""
        return (np.abs(self.estimated_m_per_s) > limit_m_per_s) & self.bears


@dataclass(frozen=True, slots=True)
class DetectionScore:
    """How good a detector is; samples of all segments count alike.

    Attributes:
        precision: Share of what it tells that is slip; NaN if it tells none.
        recall: Share of slip that it tells; NaN if there is none.
        base_rate: Share of all samples that are slip: the precision of a blind guess.
        false_alarms_per_s: Alarms during which the segment never slips, of all segments together, 1/s.
        episodes: Number of true slips of at least the window's length.
        found: Share of these episodes that it tells, sooner or later.
        delay_s: Median time from the beginning of such an episode to the first sample told, of those found, s.
        correlation: Of true and estimated speed where the segment truly bears load or is told to.
    """

    precision: float
    recall: float
    base_rate: float
    false_alarms_per_s: float
    episodes: int
    found: float
    delay_s: float
    correlation: float


def detect_slip(run: Run, detector: SlipDetector | None = None) -> Detection:
    """Has a detector read a run sample by sample, with the true slip beside it.

    Args:
        run: The run of a 3D worm.
        detector: The detector; default: `annelid.control.slip_detector.SlipDetector` as it is.

    Raises:
        RunFileError: The run has no touch.
    """
    data = run.data
    if "touch" not in data or data.sizes.get("time", 0) < 2:
        raise RunFileError(f"{run.path} holds no touch of a skin: only runs of the 3D worm do")
    time, stretch, touch = (data[name].values for name in ("time", "stretch_length", "touch"))
    rest = np.broadcast_to(data["stretch_rest_length"].values, stretch.shape)
    n_segments = touch.shape[1]
    reader = SlipDetector(n_segments) if detector is None else detector
    reader.reset()
    nothing = np.zeros(0)
    estimated, bears = np.zeros((len(time), n_segments)), np.zeros((len(time), n_segments), dtype=bool)
    for i in range(len(time)):
        reader.read(Sensation(float(time[i]), stretch[i], rest[i], nothing, nothing, nothing, nothing, touch[i]))
        estimated[i], bears[i] = reader.speed_m_per_s, reader.bears
    load = touch.sum(axis=2)
    true, carried = _windowed(data["slip_speed"].values, load, float(np.diff(time).mean()))
    slips = (np.abs(true) > SLIPPING_M_PER_S) & (carried >= LEAST_LOAD_N)
    return Detection(time, slips, true, estimated, bears)


def _windowed(values: Array, load_N: Array, interval_s: float) -> tuple[Array, Array]:
    """Means over a window around each sample, of values weighted by load and of the load, both of the same shape."""
    width = max(1, 2 * round(0.5 * (WINDOW_S / interval_s - 1.0)) + 1)
    kernel = np.full(width, 1.0 / width)

    def mean(signal: Array) -> Array:
        return np.stack([np.convolve(column, kernel, mode="same") for column in signal.T], axis=1)

    load = mean(load_N)
    return mean(values * load_N) / np.where(load > 0.0, load, 1.0), load


def score_detections(detections: list[Detection], limit_m_per_s: float) -> DetectionScore:
    """Scores a detector over several runs together.

    Args:
        detections: What it made of each run.
        limit_m_per_s: Estimated speed above which it reports slip, m/s.
    """
    alarms = episodes = 0
    delays = list[float]()
    told = [one.alarms(limit_m_per_s) for one in detections]
    for one, alarm in zip(detections, told, strict=True):
        for of_segment, truly in zip(alarm.T, one.slips.T, strict=True):
            alarms += sum(not truly[first:last].any() for first, last in _stretches(of_segment))
            for first, last in _stretches(truly):
                if one.time_s[last - 1] - one.time_s[first] >= WINDOW_S:
                    episodes += 1
                    within = np.flatnonzero(of_segment[first:last])
                    delays += [float(one.time_s[first + within[0]] - one.time_s[first])] if within.size else []
    hits = sum(int((alarm & one.slips).sum()) for one, alarm in zip(detections, told, strict=True))
    slips = sum(int(one.slips.sum()) for one in detections)
    return DetectionScore(
        precision=_share(hits, sum(int(alarm.sum()) for alarm in told)),
        recall=_share(hits, slips),
        base_rate=_share(slips, sum(one.slips.size for one in detections)),
        false_alarms_per_s=_share(alarms, sum(float(one.time_s[-1] - one.time_s[0]) for one in detections)),
        episodes=episodes,
        found=_share(len(delays), episodes),
        delay_s=float(np.median(delays)) if delays else float("nan"),
        correlation=_correlation(detections),
    )


def _share(part: float, whole: float) -> float:
    return part / whole if whole else float("nan")


def _correlation(detections: list[Detection]) -> float:
    counts = [one.bears | one.slips for one in detections]
    true = np.concatenate([one.true_m_per_s[where] for one, where in zip(detections, counts, strict=True)])
    estimated = np.concatenate([one.estimated_m_per_s[where] for one, where in zip(detections, counts, strict=True)])
    if true.size < 2 or not (np.ptp(true) > 0.0 and np.ptp(estimated) > 0.0):
        return float("nan")
    return float(np.corrcoef(true, estimated)[0, 1])


def _stretches(on: Bools) -> list[tuple[int, int]]:
    """Returns from which sample up to which (not with it) a signal is on, without a break."""
    edges = np.flatnonzero(np.diff(on, prepend=False, append=False))
    return list(zip(edges[0::2].tolist(), edges[1::2].tolist(), strict=True))


def precision_recall(detections: list[Detection], limits_m_per_s: Array) -> tuple[Array, Array]:
    """Scores a detector over several runs together for every limit.

    Args:
        detections: What it made of each run.
        limits_m_per_s: Estimated speeds above which it reports slip, m/s, ``(n_limits,)``.

    Returns:
        Recall and precision, each ``(n_limits,)``.
    """
    scores = [score_detections(detections, float(limit)) for limit in limits_m_per_s]
    return np.array([one.recall for one in scores]), np.array([one.precision for one in scores])
