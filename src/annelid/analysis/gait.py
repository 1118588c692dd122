"""How a worm gets along: speed, stride, slip, cost of transport, turning, and where its muscles' work went.

Everything is told for whole cycles behind the first one, from one contraction of segment 1 to a later one; the energy
balance for the whole run. docs/gait.md has the definitions with their formulae and sources.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from annelid.analysis.balance import EnergyBalance, energy_balance
from annelid.analysis.circle import fitted_circle
from annelid.analysis.forces import net_work, positive_work
from annelid.analysis.rhythm import rhythm, segment_activation
from annelid.analysis.travel import first_heading
from annelid.config import WormBody

if TYPE_CHECKING:
    import xarray as xr

    from annelid.simulation.runfile import Run

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Gait:
    """How a worm gets along. A number that cannot be told is None (null in JSON), never NaN.

    Attributes:
        start_s: Beginning of the first whole cycle that counts, s.
        end_s: End of the last one, s.
        cycles: Number of whole cycles between them.
        period_s: Mean duration of these cycles, s.
        speed_m_per_s: Way of the centre of mass towards the front over time, negative backwards, m/s.
        speed_body_lengths_per_s: The same over the length of the body at rest, 1/s.
        stride_m: Way towards the front per cycle, m.
        stride_body_lengths: The same over the length of the body at rest.
        contact_duty: Per segment: share of the time in which it touches the ground.
        slip_ratio: Way that segments slide on the ground, their mean, over the way of the centre of mass.
        backward_ratio: Way of the centre of mass away from the front over that towards it; it is no measure of slip.
        cost_of_transport: Positive work of the muscles over weight and way: what a muscle takes up is not regained.
        cost_of_transport_net: The same with what they take up subtracted.
        cost_of_transport_cables: Force times half of every change of length, over weight and way.
        lateral_drift: Way sideways per way towards the front, positive to the left.
        heading_change_rad: Change of the heading from the first cycle to the last, positive to the left, rad.
        turning_radius_m: Radius of the circle through the track, positive to the left, m; None for a straight one.
        energy: Where the muscles' work of the whole run went.
    """

    start_s: float | None = None
    end_s: float | None = None
    cycles: int = 0
    period_s: float | None = None
    speed_m_per_s: float | None = None
    speed_body_lengths_per_s: float | None = None
    stride_m: float | None = None
    stride_body_lengths: float | None = None
    contact_duty: list[float] | None = None
    slip_ratio: float | None = None
    backward_ratio: float | None = None
    cost_of_transport: float | None = None
    cost_of_transport_net: float | None = None
    cost_of_transport_cables: float | None = None
    lateral_drift: float | None = None
    heading_change_rad: float | None = None
    turning_radius_m: float | None = None
    energy: EnergyBalance | None = None

    def to_dict(self) -> dict[str, Any]:
        """Returns plain lists, numbers, strings and None, ready for JSON."""
        return asdict(self)


def gait(run: Run) -> Gait:
    """Reads how a worm gets along from its run.

    Args:
        run: A finished, stopped or interrupted run, opened with `annelid.simulation.runfile.open_run`.

    Returns:
        The record; all but the energy balance is None where there is no whole cycle behind the first one.
    """
    energy = energy_balance(run.data)
    marks = cycle_marks(run)
    if marks.size < 2 or "center_of_mass" not in run.data:
        return Gait(energy=energy)
    data, duration = _between(run.data, marks[0], marks[-1]), float(marks[-1] - marks[0])
    cycles = marks.size - 1
    steps, headings = _steps(run, marks)
    ahead = (steps * headings).sum(axis=1)
    left = steps[:, 1] * headings[:, 0] - steps[:, 0] * headings[:, 1]
    forwards, way = float(ahead.sum()), float(np.hypot(*steps.T).sum())
    length_m = run.data.attrs.get("body_length_m")
    weight_N = _weight(run)
    angles = np.unwrap(np.arctan2(headings[:, 1], headings[:, 0]))
    return Gait(
        start_s=float(marks[0]),
        end_s=float(marks[-1]),
        cycles=cycles,
        period_s=duration / cycles,
        speed_m_per_s=_ratio(forwards, duration),
        speed_body_lengths_per_s=_ratio(forwards / duration, length_m),
        stride_m=_ratio(forwards, cycles),
        stride_body_lengths=_ratio(forwards / cycles, length_m),
        contact_duty=_duty(data),
        slip_ratio=_ratio(_slid(data), way),
        backward_ratio=_backward_ratio(run, data),
        cost_of_transport=_ratio(_total(positive_work(data)), _product(weight_N, way)),
        cost_of_transport_net=_ratio(_total(net_work(data)), _product(weight_N, way)),
        cost_of_transport_cables=_ratio(_cable_work(data), _product(weight_N, way)),
        lateral_drift=_ratio(float(left.sum()), forwards),
        heading_change_rad=float(angles[-1] - angles[0]) if isinstance(run.config.body, WormBody) else None,
        turning_radius_m=_turning_radius(data),
        energy=energy,
    )


def cycle_marks(run: Run) -> Array:
    """Returns the times between which cycles lie, s: onsets of segment 1's contractions but the first one."""
    data, n_segments = run.data, run.config.body.n_segments
    if "activation" not in data or data.sizes.get("time", 0) < 2:
        return np.empty(0)
    beat = rhythm(data["time"].values, segment_activation(data["activation"].values, n_segments))
    of_first = [onset for segment, onset in zip(beat.order, beat.onsets_s, strict=True) if segment == 1]
    return np.array(of_first[1:])


def _between(data: xr.Dataset, start_s: float, end_s: float) -> xr.Dataset:
    """Cuts all signals to the samples from one time to another."""
    time = data["time"].values
    return data.isel(time=np.flatnonzero((time >= start_s) & (time <= end_s)))


def _steps(run: Run, marks: Array) -> tuple[Array, Array]:
    """Returns the centre of mass's way and the mean heading in each cycle, seen from above, ``(n_cycles, 2)`` each."""
    time = run.data["time"].values
    centre = run.data["center_of_mass"].sel(axis=["x", "y"]).values
    places = np.array([np.interp(marks, time, along) for along in centre.T])
    steps = np.diff(places.T, axis=0)
    if not isinstance(run.config.body, WormBody) or run.data.sizes.get("frame", 0) < 2:
        return steps, np.broadcast_to(first_heading(run), steps.shape)
    # The mesh comes with the engine, which the numbers of a planar worm do without.
    from annelid.analysis.track import track_of

    track = track_of(run)
    # Evenly over each cycle, whatever the interval of the frames.
    times = marks[:-1, np.newaxis] + np.diff(marks)[:, np.newaxis] * np.linspace(0.0, 1.0, 64, endpoint=False)
    angle = np.interp(times, track.time_s, track.heading_rad).mean(axis=1)
    return steps, -np.array([np.cos(angle), np.sin(angle)]).T


def _duty(data: xr.Dataset) -> list[float] | None:
    if "contact_force" not in data:
        return None
    touches = (data["contact_force"] != 0.0).any("axis")
    return touches.mean("time").values.tolist()


def _slid(data: xr.Dataset) -> float | None:
    return float(np.ptp(data["slip_distance"].values, axis=0).mean()) if "slip_distance" in data else None


def _backward_ratio(run: Run, data: xr.Dataset) -> float | None:
    """Way of the centre of mass against the heading over that along it, along the mean heading of the window."""
    centre = data["center_of_mass"].sel(axis=["x", "y"]).values
    ends = data["time"].values[[0, -1]]
    ahead = np.diff(centre @ _steps(run, ends)[1][0])
    return _ratio(float(-ahead[ahead < 0].sum()), float(ahead[ahead > 0].sum()))


def _total(work_J: Array | None) -> float | None:
    return None if work_J is None else float(work_J.sum())


def _cable_work(data: xr.Dataset) -> float | None:
    """Adds force times half of every change of length; a sample's force acted during the step before it."""
    if "muscle_force" not in data or "ring_length" not in data:
        return None
    changes = np.abs(np.diff(data["ring_length"].values, axis=0))
    return float((data["muscle_force"].values[1:] * changes).sum() / 2)


def _weight(run: Run) -> float | None:
    mass_kg = run.data.attrs.get("total_mass_kg")
    return None if mass_kg is None or run.config.arena is None else mass_kg * run.config.arena.gravity_m_per_s2


def _turning_radius(data: xr.Dataset) -> float | None:
    circle = fitted_circle(data["center_of_mass"].sel(axis=["x", "y"]).values)
    return circle.signed_radius_m if circle is not None and circle.is_told else None


def _product(a: float | None, b: float | None) -> float | None:
    return None if a is None or b is None else a * b


def _ratio(of: float | None, to: float | None) -> float | None:
    """Divides, where there is something to divide by."""
    if of is None or to is None or not to:
        return None
    ratio = of / to
    return ratio if math.isfinite(ratio) else None
