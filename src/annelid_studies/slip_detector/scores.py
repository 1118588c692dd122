"""A slip detector judged by the slip that the simulator knows of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from annelid.analysis import stretches
from annelid.errors import RunFileError
from annelid.protocols import Array, Sensation
from annelid.simulation import Run
from annelid_studies.slip_detector.detector import SlipDetector

SLIPPING_M_PER_S = 0.05
"""A segment truly slips while what touches of it moves faster than this along the body, on average over the window."""
LEAST_LOAD_N = 1.0
"""A segment that bears less on average over the window does not slip: it is in the air, or about to be."""
WINDOW_S = 0.05
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Detection:
    """What slipped, and what a detector made of it; arrays but the times are ``(n_times, n_segments)``."""

    time_s: Array  # of the samples, (n_times,)
    slips: Bools  # which segments truly slip
    true_m_per_s: Array  # their true speeds over the ground along the body
    estimated_m_per_s: Array  # the detector's estimates
    bears: Bools  # where the detector finds enough load for slip

    def alarms(self, limit_m_per_s: float) -> Bools:
        """Returns where the detector reports slip with this limit, ``(n_times, n_segments)``."""
        return (np.abs(self.estimated_m_per_s) > limit_m_per_s) & self.bears


@dataclass(frozen=True, slots=True)
class DetectionScore:
    """How good a detector is; samples of all segments count alike, NaN where there is nothing to divide by."""

    precision: float  # share of its alarms that is slip
    recall: float  # share of slip that it reports
    base_rate: float  # share of all samples that are slip: the precision of a blind guess
    false_alarms_per_s: float  # alarms during which the segment never slips, of all segments together
    episodes: int  # true slips of at least the window's length
    found: float  # share of these episodes that it reports, sooner or later
    delay_s: float  # median time from the beginning of such an episode to the first alarm, of those found
    correlation: float  # of true and estimated speed where the segment bears load, truly or by the detector


def detect_slip(run: Run) -> Detection:
    """Has the detector read a run of a 3D worm sample by sample, with the true slip beside it.

    Raises:
        RunFileError: The run has no touch.
    """
    data = run.data
    if "touch" not in data or data.sizes.get("time", 0) < 2:
        raise RunFileError(f"{run.path} holds no touch of a skin: only runs of the 3D worm do")
    time, stretch, touch = (data[name].values for name in ("time", "stretch_length", "touch"))
    rest = np.broadcast_to(data["stretch_rest_length"].values, stretch.shape)
    reader = SlipDetector(touch.shape[1])
    nothing = np.zeros(0)
    estimated, bears = np.zeros(touch.shape[:2]), np.zeros(touch.shape[:2], dtype=bool)
    for i in range(len(time)):
        reader.read(Sensation(float(time[i]), stretch[i], rest[i], nothing, nothing, nothing, nothing, touch[i]))
        estimated[i], bears[i] = reader.speed_m_per_s, reader.bears
    # Over a window about each sample: speed weighted by load, and load.
    width = max(1, 2 * round(0.5 * (WINDOW_S / float(np.diff(time).mean()) - 1.0)) + 1)
    load = touch.sum(axis=2)
    carried = _windowed(load, width)
    true = _windowed(data["slip_speed"].values * load, width) / np.where(carried > 0.0, carried, 1.0)
    slips = (np.abs(true) > SLIPPING_M_PER_S) & (carried >= LEAST_LOAD_N)
    return Detection(time, slips, true, estimated, bears)


def _windowed(signal: Array, width: int) -> Array:
    kernel = np.full(width, 1.0 / width)
    return np.stack([np.convolve(column, kernel, mode="same") for column in signal.T], axis=1)


def score_detections(detections: list[Detection], limit_m_per_s: float) -> DetectionScore:
    """Scores a detector over several runs together.

    Args:
        detections: What it made of each run.
        limit_m_per_s: Estimated speed above which it reports slip, m/s.
    """
    n_false = episodes = 0
    delays = list[float]()
    alarms = [one.alarms(limit_m_per_s) for one in detections]
    for one, alarm in zip(detections, alarms, strict=True):
        for of_segment, truly in zip(alarm.T, one.slips.T, strict=True):
            n_false += sum(not truly[first:last].any() for first, last in stretches(of_segment))
            for first, last in stretches(truly):
                if one.time_s[last - 1] - one.time_s[first] >= WINDOW_S:
                    episodes += 1
                    within = np.flatnonzero(of_segment[first:last])
                    delays += [float(one.time_s[first + within[0]] - one.time_s[first])] if within.size else []
    alarm, slips = (np.concatenate([np.ravel(x) for x in each]) for each in (alarms, [one.slips for one in detections]))
    counts = slips | np.concatenate([one.bears.ravel() for one in detections])
    true = np.concatenate([one.true_m_per_s.ravel() for one in detections])[counts]
    estimated = np.concatenate([one.estimated_m_per_s.ravel() for one in detections])[counts]
    varies = true.size > 1 and np.ptp(true) > 0.0 and np.ptp(estimated) > 0.0
    hits = int((alarm & slips).sum())
    return DetectionScore(
        precision=_share(hits, int(alarm.sum())),
        recall=_share(hits, int(slips.sum())),
        base_rate=_share(int(slips.sum()), slips.size),
        false_alarms_per_s=_share(n_false, sum(float(one.time_s[-1] - one.time_s[0]) for one in detections)),
        episodes=episodes,
        found=_share(len(delays), episodes),
        delay_s=float(np.median(delays)) if delays else float("nan"),
        correlation=float(np.corrcoef(true, estimated)[0, 1]) if varies else float("nan"),
    )


def _share(part: float, whole: float) -> float:
    return part / whole if whole else float("nan")


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
