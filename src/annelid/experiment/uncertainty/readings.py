"""The numbers of a run that get error bars."""

from __future__ import annotations

from dataclasses import dataclass

from annelid.analysis import Summary


@dataclass(frozen=True, slots=True)
class Reading:
    """One number of a run.

    Attributes:
        name: Field of the summary, with the segment behind a point where it has one a segment.
        label: What it is called.
        unit: Unit of the value.
        value: In SI units; None where it cannot be told.
        shown_unit: Unit in which it is shown.
        factor: What the value is multiplied by for that.
        digits: Digits behind the point where there is no error to tell them from.
    """

    name: str
    label: str
    unit: str
    value: float | None
    shown_unit: str
    factor: float
    digits: int


def readings(numbers: Summary) -> list[Reading]:
    """Picks from a summary what gets error bars.

    Elongations stand in both readings (`annelid.analysis.elongation`), "mean" and "pp"; speed is travel over duration.
    """
    found = [Reading("period_s", "period", "s", numbers.period_s, "s", 1.0, 3)]
    for field, label in (
        ("elongation_mean_max_m", "elongation {}, mean"),
        ("elongation_first_helix_pp_m", "first helix {}, pp"),
    ):
        lengths: list[float | None] = getattr(numbers, field) or [None] * numbers.n_segments
        found += [
            Reading(f"{field}.{segment}", label.format(segment), "m", value, "cm", 100.0, 2)
            for segment, value in enumerate(lengths, start=1)
        ]
    moved, took = numbers.travel_m, numbers.duration_s
    speed = moved / took if moved is not None and took else None
    return [
        *found,
        Reading("middle_deficit_mean", "middle deficit, mean", "1", numbers.middle_deficit_mean, "%", 100.0, 1),
        Reading("middle_deficit", "middle deficit, pp", "1", numbers.middle_deficit, "%", 100.0, 1),
        Reading("contraction_force_median_N", "force, median", "N", numbers.contraction_force_median_N, "N", 1.0, 2),
        Reading("travel_m", "travel forwards", "m", moved, "mm", 1000.0, 1),
        Reading("speed_m_per_s", "speed", "m/s", speed, "mm/s", 1000.0, 2),
    ]
