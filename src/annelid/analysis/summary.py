"""The numbers of one run, in one record that prints and saves without surprises."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from annelid.analysis.gait import muscle_work
from annelid.analysis.rhythm import CONTRACTED, Rhythm, run_rhythm
from annelid.analysis.track import forward_position
from annelid.protocols import Array
from annelid.simulation.runfile import Run

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, slots=True)
class Summary:
    """What a run amounts to. A number that is not known is None (null in JSON), never NaN.

    Attributes:
        name: Name of the configuration.
        status: How the run ended, as the run file says.
        n_segments: Number of actuated segments.
        duration_s: Simulated time in the file, s.
        real_time_factor: Simulated time over wall-clock time.
        order: Segments (from 1) in the order of their contractions.
        onsets_s: Times of those contractions, s, aligned with ``order``.
        wave: Whether the order is 1-2-..-N repeated.
        full_cycles: Number of complete waves.
        period_s: Mean interval between contractions of one segment, s.
        period_std_s: Standard deviation of those intervals, s.
        elongation_first_helix_pp_m: Per segment: peak to peak of the spring on the first helix, m.
        elongation_mean_max_m: Per segment: largest mean of its sensors above rest, m.
        elongation_least_pp_m: Per segment: peak to peak of the sensor with which it is least, m; None where a segment
            has one sensor only.
        elongation_most_pp_m: The same of the sensor with which it is most, m.
        middle_deficit: Interior segments below the first, first reading, a fraction.
        middle_deficit_mean: The same for the second reading.
        end_difference: Last segment below the first, first reading, a fraction.
        contraction_force_median_N: Median muscle force while contracted, N.
        contraction_force_peak_N: Largest recorded muscle force while contracted, N.
        segment_force_median_N: Per segment: median force of its muscles while contracted, N.
        segment_force_peak_N: Per segment: largest force of its muscles while contracted, N.
        positive_work_J: Per segment: work of its muscles while it was positive, J; none of it is regained.
        muscle_work_J: Per segment: net work of its muscles, J; where no work is summed, force over shortening.
        travel_m: Displacement of the centre of mass along the initial heading, negative backwards, m.
        travel_path_m: Length of its path forwards and backwards along that direction, m.
        ring_length_min_m: Shortest ring during the run, m (planar worm: height of a rhombus).
        edge_strain_max: Largest strain of any edge of a rod.
        pin_gap_max_m: Largest distance between two pinned strands, m.
        warnings: What is doubtful about the run, a sentence each.
    """

    name: str
    status: str
    n_segments: int
    duration_s: float | None
    real_time_factor: float | None
    order: list[int]
    onsets_s: list[float]
    wave: bool | None
    full_cycles: int
    period_s: float | None
    period_std_s: float | None
    elongation_first_helix_pp_m: list[float | None] | None
    elongation_mean_max_m: list[float | None] | None
    middle_deficit: float | None
    middle_deficit_mean: float | None
    end_difference: float | None
    contraction_force_median_N: float | None
    contraction_force_peak_N: float | None
    segment_force_median_N: list[float | None] | None
    segment_force_peak_N: list[float | None] | None
    positive_work_J: list[float | None] | None
    muscle_work_J: list[float | None] | None
    travel_m: float | None
    travel_path_m: float | None
    ring_length_min_m: float | None
    edge_strain_max: float | None
    pin_gap_max_m: float | None
    elongation_least_pp_m: list[float | None] | None = None
    elongation_most_pp_m: list[float | None] | None = None
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Takes the warnings as JSON has them, too."""
        object.__setattr__(self, "warnings", tuple(self.warnings or ()))

    def to_dict(self) -> dict[str, Any]:
        """Returns plain lists, numbers, strings and None, ready for JSON."""
        return asdict(self)

    def to_json(self) -> str:
        """Returns the record as JSON with the attributes' names as keys."""
        return json.dumps(self.to_dict(), indent=2, allow_nan=False)


def summary(run: Run) -> Summary:
    """Reads the numbers of a run, opened with `annelid.open_run`.

    Quantities whose variables the file lacks (a planar run has no edges) are None.
    """
    data = run.data
    n_segments = run.config.body.n_segments
    sampled = bool(data.sizes.get("time"))
    beat = run_rhythm(run) or Rhythm((), (), None, None, None, 0)
    first_helix = mean = spread = None
    if "stretch_length" in data and sampled:
        # The paper does not say how it read its Fig. 7; its numbers come out as the peak to peak on the first helix.
        stretch, rest = data["stretch_length"].values, data["stretch_rest_length"].values
        peak_to_peak = np.ptp(stretch, axis=0)
        first_helix, mean = peak_to_peak[:, 0], stretch.mean(axis=2).max(axis=0) - rest.mean(axis=1)
        spread = peak_to_peak if data.sizes["sensor"] > 1 else None
    forces = _contraction_forces(data, n_segments)
    pulling = np.concatenate([np.empty(0), *forces])
    ahead = forward_position(run) if "center_of_mass" in data and sampled else None
    shortest = None
    if "ring_length" in data and sampled:
        # A ring of two halves is as long as both.
        shortest = data["ring_length"].values.reshape(data.sizes["time"], n_segments, -1).sum(axis=2).min()
    return Summary(
        name=run.config.name,
        status=run.status,
        n_segments=n_segments,
        duration_s=_number(np.ptp(data["time"].values)) if sampled else None,
        real_time_factor=_number(run.real_time_factor),
        order=list(beat.order),
        onsets_s=list(beat.onsets_s),
        wave=beat.wave,
        full_cycles=beat.full_cycles,
        period_s=beat.period_s,
        period_std_s=beat.period_std_s,
        elongation_first_helix_pp_m=_numbers(first_helix),
        elongation_mean_max_m=_numbers(mean),
        middle_deficit=_number(middle_deficit(first_helix)) if first_helix is not None else None,
        middle_deficit_mean=_number(middle_deficit(mean)) if mean is not None else None,
        end_difference=_number(end_difference(first_helix)) if first_helix is not None else None,
        contraction_force_median_N=_number(np.median(pulling)) if pulling.size else None,
        contraction_force_peak_N=_number(pulling.max()) if pulling.size else None,
        segment_force_median_N=_numbers([np.median(one) if one.size else None for one in forces] or None),
        segment_force_peak_N=_numbers([one.max() if one.size else None for one in forces] or None),
        positive_work_J=_by_segment(muscle_work(data, positive=True), n_segments),
        muscle_work_J=_by_segment(muscle_work(data), n_segments),
        travel_m=None if ahead is None else _number(ahead[-1] - ahead[0]),
        travel_path_m=None if ahead is None else _number(np.abs(np.diff(ahead)).sum()),
        ring_length_min_m=_number(shortest),
        edge_strain_max=_largest(data, "edge_strain"),
        pin_gap_max_m=_largest(data, "pin_gap"),
        elongation_least_pp_m=None if spread is None else _numbers(spread.min(axis=1)),
        elongation_most_pp_m=None if spread is None else _numbers(spread.max(axis=1)),
        warnings=run.warnings,
    )


def _contraction_forces(data: xr.Dataset, n_segments: int) -> list[Array]:
    """Forces of all samples in which the muscle itself is contracted, an array per segment; empty without forces.

    The short transient at each onset is in there: it sets the peak and hardly moves the median.
    """
    if "muscle_force" not in data or "activation" not in data:
        return []
    muscles = np.split(np.arange(data.sizes["muscle"]), n_segments)
    force, contracted = data["muscle_force"].values, data["activation"].values > CONTRACTED
    return [force[:, own][contracted[:, own]] for own in muscles]


def _by_segment(of_muscles: Array | None, n_segments: int) -> list[float | None] | None:
    return None if of_muscles is None else _numbers(of_muscles.reshape(n_segments, -1).sum(axis=1))


def _largest(data: xr.Dataset, name: str) -> float | None:
    return _number(data[name].values.max()) if name in data and data[name].size else None


def _number(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def _numbers(values: Iterable[float | None] | None) -> list[float | None] | None:
    return None if values is None else [_number(value) for value in values]


def middle_deficit(elongation_m: ArrayLike) -> float:
    """How far the interior segments stay below the first: ``1 - mean(interior) / first``, NaN if that is unmoved.

    With three segments this is the paper's "segment 2 below segment 1" (39.4 %).
    """
    values = np.asarray(elongation_m, dtype=float)
    return _deficit(values[1:-1].mean(), values[0])


def interior_deficit(elongation_m: ArrayLike) -> float:
    """How far the interior segments stay below both ends: ``1 - mean(interior) / mean(ends)``."""
    values = np.asarray(elongation_m, dtype=float)
    return _deficit(values[1:-1].mean(), (values[0] + values[-1]) / 2.0)


def end_difference(elongation_m: ArrayLike) -> float:
    """How far the last segment stays below the first: ``1 - last / first``."""
    values = np.asarray(elongation_m, dtype=float)
    return _deficit(values[-1], values[0])


def _deficit(less: float, full: float) -> float:
    return float(1.0 - less / full) if full > 0 else float("nan")
