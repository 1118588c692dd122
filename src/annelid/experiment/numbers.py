"""The numbers of a run that a study's dataset has, each with its unit and its name in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from annelid.config import unit_of
from annelid.errors import ConfigError, suggest
from annelid.experiment.outcome import Outcome

Part = Literal["summary", "gait", "energy", "rhythm"]


@dataclass(frozen=True, slots=True)
class Number:
    """One number of a run, or one per segment."""

    name: str
    """Of the variable in the dataset."""
    text: str
    """What it is, in words."""
    part: Part
    """The part of what is kept of a run that it is read from."""
    per_segment: bool = False

    @property
    def unit(self) -> str:
        """Unit that ends its name; "1" for a share or a count."""
        return unit_of(self.name) or "1"

    def read(self, outcome: Outcome) -> Any:
        """Returns its value for a run; None where it has none."""
        part = outcome.gait.energy if self.part == "energy" else getattr(outcome, self.part)
        return None if part is None else getattr(part, self.name.removeprefix(f"{self.part}_"))


def _numbers(part: Part, *, per_segment: bool = False, **texts: str) -> dict[str, Number]:
    return {name: Number(name, text, part, per_segment) for name, text in texts.items()}


NUMBERS: Mapping[str, Number] = (
    _numbers(
        "gait",
        speed_m_per_s="speed towards the front",
        speed_body_lengths_per_s="speed in body lengths",
        stride_m="travel per cycle",
        stride_body_lengths="travel per cycle in body lengths",
        slip_ratio="sliding distance over travel",
        cost_of_transport="cost of transport of the positive work",
        cost_of_transport_net="cost of transport of the net work",
        cost_of_transport_cables="cost of transport of the cables",
        backward_ratio="travel backwards over travel forwards",
        lateral_drift="travel to the left over travel forwards",
        heading_change_rad="change of heading to the left",
        turning_radius_m="turning radius, to the left",
        cycles="complete cycles that the gait is computed over",
        start_s="beginning of these cycles",
        end_s="end of these cycles",
        gait_period_s="mean duration of these cycles",
    )
    | _numbers("gait", per_segment=True, contact_duty="share of the time on the ground")
    | _numbers(
        "summary",
        period_s="mean interval between contractions of a segment",
        period_std_s="standard deviation of these intervals",
        full_cycles="complete waves",
        wave="whether segments contract in order: 1 or 0",
        travel_m="displacement of the centre of mass forwards",
        travel_path_m="its path length along x, forwards and backwards",
        middle_deficit="interior segments below the first, on the first helix",
        middle_deficit_mean="interior segments below the first, mean of all helices",
        end_difference="last segment below the first",
        contraction_force_median_N="median muscle force while contracted",
        contraction_force_peak_N="largest muscle force while contracted",
        ring_length_min_m="shortest ring",
        edge_strain_max="largest strain of an edge",
        pin_gap_max_m="largest gap between pinned strands",
        n_segments="number of segments",
        duration_s="simulated time",
        real_time_factor="simulated time over wall-clock time",
    )
    | _numbers(
        "summary",
        per_segment=True,
        elongation_first_helix_pp_m="elongation on the first helix, peak to peak",
        elongation_least_pp_m="least elongation of a segment's sensors, peak to peak",
        elongation_most_pp_m="most elongation of a segment's sensors, peak to peak",
        elongation_mean_max_m="largest mean elongation",
        segment_force_median_N="median force of the muscles while contracted",
        segment_force_peak_N="largest force of the muscles while contracted",
        positive_work_J="positive work of the muscles",
        muscle_work_J="net work of the muscles",
    )
    | _numbers(
        "energy",
        energy_muscle_work_J="net work of all muscles",
        energy_kinetic_J="gain of kinetic energy",
        energy_elastic_J="gain of elastic energy",
        energy_potential_J="gain of the energy of the weight",
        energy_slip_J="work lost to sliding friction",
        energy_constraints_J="work lost to contacts along their normal",
        energy_damping_J="work lost to dampers",
        energy_numerical_J="work lost to the integrator",
        energy_numerical_share="that over the muscles' work",
    )
    | _numbers("rhythm", rhythm_regularity="regularity of the rhythm, 1 for an even wave")
)
"""All numbers of summary, gait and energy balance by name, those first that a gait is judged by."""
PREFERRED = ("speed_m_per_s", "cost_of_transport", "slip_ratio", "period_s", "travel_m", "elongation_mean_max_m")
"""What a table and a figure show first unless the study says otherwise."""


def chosen_numbers(names: Sequence[str], rank: str | None) -> tuple[Number, ...]:
    """Returns numbers by name, all for none; the one to rank runs by must be among them, and not one per segment."""
    for name in names:
        if name not in NUMBERS:
            raise ConfigError(f"outputs: unknown number {name!r}: {suggest(name, NUMBERS)}")
    chosen = tuple(NUMBERS[name] for name in dict.fromkeys(names or NUMBERS))
    scalars = [number.name for number in chosen if not number.per_segment]
    if rank is not None and rank not in scalars:
        raise ConfigError(
            f"rank = {rank!r}: must be one of the outputs with one number a run: {suggest(rank, scalars)}"
        )
    return chosen
