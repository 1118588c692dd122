"""Locomotion metrics: speed, stride, slip, cost of transport, turning, and where the muscles' work went.

Everything is computed over complete cycles behind the first one, from one contraction of segment 1 to a later one; the
energy balance over the whole run. docs/gait.md has the definitions with their formulae and sources.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from annelid.analysis.rhythm import run_rhythm
from annelid.analysis.track import first_heading, fitted_circle, forward_position, track_of
from annelid.protocols import Array
from annelid.simulation.runfile import Run

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, slots=True)
class EnergyBalance:
    """The muscles' work from the first sample of a run to its last, and what became of it, J.

    ``muscle_work = kinetic + elastic + potential + slip + constraints + damping + numerical``. What a worm does not
    have (a planar one no weight) is None and counts as nothing.

    Attributes:
        muscle_work_J: Net work that the ring muscles did on the body.
        kinetic_J: Gain of kinetic energy.
        elastic_J: Gain of the energy of strands and springs.
        potential_J: Gain of the energy of the weight.
        slip_J: Lost to friction of what slides.
        constraints_J: Lost to contacts along their normal and to other constraints; soft contacts may give back.
        damping_J: Lost to dampers.
        numerical_J: What is left: lost to the integrator.
        numerical_share: That over the muscles' work; None without any.
    """

    muscle_work_J: float
    kinetic_J: float
    elastic_J: float
    potential_J: float | None
    slip_J: float | None
    constraints_J: float | None
    damping_J: float
    numerical_J: float
    numerical_share: float | None


@dataclass(frozen=True, slots=True)
class Gait:
    """How a worm moves. A number that cannot be computed is None (null in JSON), never NaN.

    Attributes:
        start_s: Beginning of the first complete cycle that counts, s.
        end_s: End of the last one, s.
        cycles: Number of complete cycles between them.
        period_s: Mean duration of these cycles, s.
        speed_m_per_s: Travel of the centre of mass towards the front over time, negative backwards, m/s.
        speed_body_lengths_per_s: The same over the length of the body at rest, 1/s.
        stride_m: Travel towards the front per cycle, m.
        stride_body_lengths: The same over the length of the body at rest.
        contact_duty: Per segment: share of the time in which it touches the ground.
        slip_ratio: Sliding distance on the ground, mean of the segments, over the path of the centre of mass.
        backward_ratio: Travel of the centre of mass away from the front over that towards it; it is no measure of slip.
        cost_of_transport: Positive work of the muscles over weight times path: what a muscle takes up is not regained.
        cost_of_transport_net: The same with what they take up subtracted.
        cost_of_transport_cables: Force times half of every change of length, over weight times path.
        lateral_drift: Travel sideways per travel towards the front, positive to the left.
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
    """Reads the locomotion metrics of a run, opened with `annelid.open_run`.

    All but the energy balance is None where there is no complete cycle behind the first one.
    """
    energy = energy_balance(run.data)
    marks = cycle_marks(run)
    if marks.size < 2 or "center_of_mass" not in run.data:
        return Gait(energy=energy)
    time = run.data["time"].values
    data = run.data.isel(time=np.flatnonzero((time >= marks[0]) & (time <= marks[-1])))
    duration, cycles = float(marks[-1] - marks[0]), marks.size - 1
    centre = data["center_of_mass"].sel(axis=["x", "y"]).values
    steps, headings = _steps(run, marks)
    left = steps[:, 1] * headings[:, 0] - steps[:, 0] * headings[:, 1]
    forwards, path = float((steps * headings).sum(axis=1).sum()), float(np.hypot(*steps.T).sum())
    # Along the mean heading of the window.
    moves = np.diff(centre @ _steps(run, data["time"].values[[0, -1]])[1][0])
    length_m = data.attrs.get("body_length_m")
    mass_kg, arena = data.attrs.get("total_mass_kg"), run.config.arena
    push_J = None if mass_kg is None or arena is None else mass_kg * arena.gravity_m_per_s2 * path
    works = (muscle_work(data, positive=positive) for positive in (True, False))
    positive_J, net_J = (None if work is None else float(work.sum()) for work in works)
    slid_m = float(np.ptp(data["slip_distance"].values, axis=0).mean()) if "slip_distance" in data else None
    touches = (data["contact_force"] != 0.0).any("axis") if "contact_force" in data else None
    angles = np.unwrap(np.arctan2(headings[:, 1], headings[:, 0]))
    circle = fitted_circle(centre)
    return Gait(
        start_s=float(marks[0]),
        end_s=float(marks[-1]),
        cycles=cycles,
        period_s=duration / cycles,
        speed_m_per_s=_ratio(forwards, duration),
        speed_body_lengths_per_s=_ratio(forwards / duration, length_m),
        stride_m=_ratio(forwards, cycles),
        stride_body_lengths=_ratio(forwards / cycles, length_m),
        contact_duty=None if touches is None else touches.mean("time").values.tolist(),
        slip_ratio=_ratio(slid_m, path),
        backward_ratio=_ratio(float(-moves[moves < 0].sum()), float(moves[moves > 0].sum())),
        cost_of_transport=_ratio(positive_J, push_J),
        cost_of_transport_net=_ratio(net_J, push_J),
        cost_of_transport_cables=_ratio(_cable_work(data), push_J),
        lateral_drift=_ratio(float(left.sum()), forwards),
        heading_change_rad=None if run.config.body.geometry() is None else float(angles[-1] - angles[0]),
        turning_radius_m=circle.signed_radius_m if circle is not None and circle.is_clear else None,
        energy=energy,
    )


def energy_balance(data: xr.Dataset) -> EnergyBalance | None:
    """Reads the balance from a run's signals; None where energies were not recorded, or there are no two samples."""
    recorded = ("muscle_work", "kinetic_energy", "elastic_energy", "damping_loss")
    optional = ("potential_energy", "slip_loss", "constraint_loss")
    if any(name not in data for name in recorded) or data.sizes.get("time", 0) < 2:
        return None
    work, kinetic, elastic, damping = (_summed_gain(data, name) for name in recorded)
    potential, slip, constraint = (_summed_gain(data, name) if name in data else None for name in optional)
    other = None if constraint is None else constraint - (slip or 0.0)
    left = work - sum((kinetic, elastic, damping, potential or 0.0, slip or 0.0, other or 0.0))
    return EnergyBalance(work, kinetic, elastic, potential, slip, other, damping, left, left / work if work else None)


def _summed_gain(data: xr.Dataset, name: str) -> float:
    """What a signal, summed over muscles or segments, has gained from the first sample to the last."""
    ends = data[name].values[[0, -1]]
    return float(np.sum(ends[1]) - np.sum(ends[0]))


def muscle_work(data: xr.Dataset, *, positive: bool = False) -> Array | None:
    """Returns the work of every muscle on the body from a run's first sample to its last, J, ``(n_muscles,)``.

    What a muscle takes up while it is lengthened is subtracted, or with ``positive`` not regained. Where no such sum is
    recorded, the changes from sample to sample are added; without work they are force over shortening, or None.
    """
    recorded, least_J = ("positive_work", 0.0) if positive else ("muscle_work", -np.inf)
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


def _cable_work(data: xr.Dataset) -> float | None:
    """Adds force times half of every change of length; a sample's force acted during the step before it."""
    if "muscle_force" not in data or "ring_length" not in data:
        return None
    changes = np.abs(np.diff(data["ring_length"].values, axis=0))
    return float((data["muscle_force"].values[1:] * changes).sum() / 2)


def cycle_marks(run: Run) -> Array:
    """Returns the times between which cycles lie, s: onsets of segment 1's contractions but the first one."""
    beat = run_rhythm(run) if run.data.sizes.get("time", 0) > 1 else None
    if beat is None:
        return np.empty(0)
    return np.array([onset for segment, onset in zip(beat.order, beat.onsets_s, strict=True) if segment == 1][1:])


def _steps(run: Run, marks: Array) -> tuple[Array, Array]:
    """Displacement of the centre of mass and mean heading in each cycle, seen from above, ``(n_cycles, 2)`` each."""
    time = run.data["time"].values
    centre = run.data["center_of_mass"].sel(axis=["x", "y"]).values
    steps = np.diff(np.array([np.interp(marks, time, along) for along in centre.T]).T, axis=0)
    if run.config.body.geometry() is None or run.data.sizes.get("frame", 0) < 2:
        return steps, np.broadcast_to(first_heading(run), steps.shape)
    track = track_of(run)
    # Evenly over each cycle, whatever the interval of the frames.
    times = marks[:-1, np.newaxis] + np.diff(marks)[:, np.newaxis] * np.linspace(0.0, 1.0, 64, endpoint=False)
    angle = np.interp(times, track.time_s, track.heading_rad).mean(axis=1)
    return steps, -np.array([np.cos(angle), np.sin(angle)]).T


def _ratio(of: float | None, to: float | None) -> float | None:
    """Divides, where there is something to divide by."""
    if of is None or not to:
        return None
    return of / to if math.isfinite(of / to) else None


@dataclass(frozen=True, slots=True)
class SlipCost:
    """Speed and loss over complete cycles, from the second contraction of segment 1 to its last.

    Attributes:
        cycles: Number of complete cycles.
        period_s: Mean duration of a cycle, s.
        speed_m_per_s: Displacement of the centre of mass along the initial heading, over time, m/s.
        loss_W: Work lost to friction over time, W.
        loss_J_per_m: The same over that displacement, J/m; infinite for a worm that got nowhere or backwards.
    """

    cycles: int
    period_s: float
    speed_m_per_s: float
    loss_W: float
    loss_J_per_m: float


def slip_cost(run: Run) -> SlipCost | None:
    """Reads what a run that recorded ``slip_loss`` lost to friction; None for fewer than three contractions."""
    marks = cycle_marks(run)
    if len(marks) < 2:
        return None
    time, loss = run.data["time"].values, run.data["slip_loss"].values.sum(axis=1)
    ends = np.searchsorted(time, marks[[0, -1]])
    duration, travel, lost = (float(np.diff(each[ends])[0]) for each in (time, forward_position(run), loss))
    cycles = len(marks) - 1
    cost = lost / travel if travel > 0.0 else np.inf
    return SlipCost(cycles, duration / cycles, travel / duration, lost / duration, cost)
