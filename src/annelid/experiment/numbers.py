"""Which numbers of a run a study outputs, and by which it ranks its runs."""

from __future__ import annotations

from collections.abc import Sequence

from annelid.analysis import NUMBERS, Number
from annelid.errors import ConfigError, suggest

PREFERRED = ("speed_m_per_s", "cost_of_transport", "slip_ratio", "period_s", "travel_m", "elongation_mean_max_m")
"""What a table and a figure show first unless the study says otherwise."""


def chosen_numbers(names: Sequence[str], rank: str | None) -> tuple[Number, ...]:
    """Returns numbers by name, all for none; the one to rank runs by must be among them, and not one per segment."""
    known = {name: number for name, number in NUMBERS.items() if number.in_sweeps}
    for name in names:
        if name not in known:
            raise ConfigError(f"outputs: unknown number {name!r}: {suggest(name, known)}")
    chosen = tuple(known[name] for name in dict.fromkeys(names or known))
    scalars = [number.name for number in chosen if not number.per_segment]
    if rank is not None and rank not in scalars:
        raise ConfigError(
            f"rank = {rank!r}: must be one of the outputs with one number a run: {suggest(rank, scalars)}"
        )
    return chosen
