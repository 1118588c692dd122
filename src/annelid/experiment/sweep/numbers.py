"""The numbers of a run that a sweep tells, each with its unit and its name in words."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from annelid.errors import ConfigError, suggest
from annelid.experiment.outcome import Outcome


@dataclass(frozen=True, slots=True)
class Number:
    """One number of a run, or one a segment.

    Attributes:
        name: Of the variable in the dataset.
        unit: "1" for a share or a count.
        text: What it is, in words.
        read: Reads it from what is kept of a run; None where it cannot be told.
        per_segment: Whether it is one a segment.
    """

    name: str
    unit: str
    text: str
    read: Callable[[Outcome], Any]
    per_segment: bool = False


def _table(part: str, prefix: str, *rows: tuple[str, str, str], per_segment: bool = False) -> dict[str, Number]:
    return {
        prefix + name: Number(prefix + name, unit, text, _reader(part, name), per_segment) for name, unit, text in rows
    }


def _reader(part: str, name: str) -> Callable[[Outcome], Any]:
    def read(outcome: Outcome) -> Any:
        of = outcome.gait.energy if part == "energy" else getattr(outcome, part)
        return None if of is None else getattr(of, name)

    return read


NUMBERS: Mapping[str, Number] = {
    **_table(
        "gait",
        "",
        ("speed_m_per_s", "m/s", "speed towards the front"),
        ("speed_body_lengths_per_s", "1/s", "speed in body lengths"),
        ("stride_m", "m", "way per cycle"),
        ("stride_body_lengths", "1", "way per cycle in body lengths"),
        ("slip_ratio", "1", "sliding way over way"),
        ("cost_of_transport", "1", "cost of transport of the positive work"),
        ("cost_of_transport_net", "1", "cost of transport of the net work"),
        ("cost_of_transport_cables", "1", "cost of transport of the cables"),
        ("backward_ratio", "1", "way back over way ahead"),
        ("lateral_drift", "1", "way to the left over way ahead"),
        ("heading_change_rad", "rad", "change of heading to the left"),
        ("turning_radius_m", "m", "turning radius, to the left"),
        ("cycles", "1", "whole cycles that the gait is told of"),
        ("start_s", "s", "beginning of these cycles"),
        ("end_s", "s", "end of these cycles"),
    ),
    **_table("gait", "gait_", ("period_s", "s", "mean duration of these cycles")),
    **_table("gait", "", ("contact_duty", "1", "share of the time on the ground"), per_segment=True),
    **_table(
        "summary",
        "",
        ("period_s", "s", "mean interval between contractions of a segment"),
        ("period_std_s", "s", "standard deviation of these intervals"),
        ("full_cycles", "1", "complete waves"),
        ("wave", "1", "whether segments contract in order: 1 or 0"),
        ("travel_m", "m", "displacement of the centre of mass forwards"),
        ("travel_path_m", "m", "its way forth and back along x"),
        ("middle_deficit", "1", "interior segments below the first, on the first helix"),
        ("middle_deficit_mean", "1", "interior segments below the first, mean of all helices"),
        ("end_difference", "1", "last segment below the first"),
        ("contraction_force_median_N", "N", "median muscle force while contracted"),
        ("contraction_force_peak_N", "N", "largest muscle force while contracted"),
        ("ring_length_min_m", "m", "shortest ring"),
        ("edge_strain_max", "1", "largest strain of an edge"),
        ("pin_gap_max_m", "m", "largest gap between pinned strands"),
        ("n_segments", "1", "number of segments"),
        ("duration_s", "s", "simulated time"),
        ("real_time_factor", "1", "simulated time over wall-clock time"),
    ),
    **_table(
        "summary",
        "",
        ("elongation_first_helix_pp_m", "m", "elongation on the first helix, peak to peak"),
        ("elongation_least_pp_m", "m", "least elongation of a segment's sensors, peak to peak"),
        ("elongation_most_pp_m", "m", "most elongation of a segment's sensors, peak to peak"),
        ("elongation_mean_max_m", "m", "largest mean elongation"),
        ("segment_force_median_N", "N", "median force of the muscles while contracted"),
        ("segment_force_peak_N", "N", "largest force of the muscles while contracted"),
        ("positive_work_J", "J", "positive work of the muscles"),
        ("muscle_work_J", "J", "net work of the muscles"),
        per_segment=True,
    ),
    **_table(
        "energy",
        "energy_",
        ("muscle_work_J", "J", "net work of all muscles"),
        ("kinetic_J", "J", "gain of kinetic energy"),
        ("elastic_J", "J", "gain of elastic energy"),
        ("potential_J", "J", "gain of the energy of the weight"),
        ("slip_J", "J", "work lost to sliding friction"),
        ("constraints_J", "J", "work lost to contacts along their normal"),
        ("damping_J", "J", "work lost to dampers"),
        ("numerical_J", "J", "work lost to the integrator"),
        ("numerical_share", "1", "that over the muscles' work"),
    ),
    **_table("rhythm", "rhythm_", ("regularity", "1", "regularity of the rhythm, 1 for an even wave")),
}
"""All numbers of summary, gait and energy balance by name, those first that a gait is judged by."""
PREFERRED = ("speed_m_per_s", "cost_of_transport", "slip_ratio", "period_s", "travel_m", "elongation_mean_max_m")
"""What a table and a figure tell first unless the study says otherwise."""


def chosen_numbers(names: Sequence[str]) -> list[Number]:
    """Returns numbers by name; all for none.

    Raises:
        ConfigError: An unknown name.
    """
    for name in names:
        if name not in NUMBERS:
            raise ConfigError(f"outputs: unknown number {name!r}: {suggest(name, NUMBERS)}")
    return [NUMBERS[name] for name in dict.fromkeys(names)] if names else list(NUMBERS.values())


def check_rank(name: str | None, numbers: Sequence[Number]) -> None:
    """Refuses a number to rank runs by that is not among those kept, or is one a segment.

    Raises:
        ConfigError: It is.
    """
    scalars = [number.name for number in numbers if not number.per_segment]
    if name is not None and name not in scalars:
        raise ConfigError(
            f"rank = {name!r}: must be one of the outputs with one number a run: {suggest(name, scalars)}"
        )
