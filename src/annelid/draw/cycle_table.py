"""The table of a limit cycle: period and Floquet multipliers, with time taken in several ways."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from rich.table import Table

    from annelid.analysis.limit_cycle import LimitCycle

HEADINGS = {
    "continuous": "continuous time",
    "located": "own steps, sensors located",
    "stepped": "own steps",
}
# Products of rounded matrices tell no smaller multiplier.
_ROUNDING = 1e-12
# Keeps title and caption from folding where there is only one column.
_WIDTH = 72


def cycle_table(name: str, cycles: Mapping[str, LimitCycle], n_shown: int = 4) -> Table:
    """Lays out the limit cycles of one worm, one column for each way of taking time.

    Args:
        name: The worm.
        cycles: The cycles, by `annelid.analysis.limit_cycle.Time`.
        n_shown: Multipliers to show, the largest ones.

    Returns:
        A rich table.
    """
    from rich import box
    from rich.table import Table

    main = next(iter(cycles.values()))
    table = Table(
        title=f"{name}: limit cycle in {len(main.labels)} states",
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        min_width=_WIDTH,
    )
    table.add_column("quantity", overflow="fold")
    for time in cycles:
        table.add_column(HEADINGS[time], overflow="fold")
    table.add_row("period (ms)", *(f"{1e3 * cycle.period_s:.2f}" for cycle in cycles.values()))
    for i in range(min(n_shown, len(main.labels))):
        table.add_row(f"multiplier {i + 1}", *(_multiplier(cycle.multipliers[i]) for cycle in cycles.values()))
    table.add_row("orbit closes within", *(f"{cycle.closing_error:.0e} of a range" for cycle in cycles.values()))
    table.caption = (
        "A multiplier is what one cycle leaves of a small deviation; the one at 1 is a shift along the cycle."
    )
    if set(cycles) != {"continuous"}:
        table.caption += " In steps none is at 1: a shift by less than a step is not one along the cycle."
    table.caption_justify = "left"
    return table


def cycle_numbers(cycles: Mapping[str, LimitCycle]) -> dict[str, Any]:
    """Returns the same numbers for JSON: multipliers as pairs of real and imaginary part, times in s."""
    return {
        time: {
            "period_s": cycle.period_s,
            "timestep_s": cycle.timestep_s,
            "closing_error": cycle.closing_error,
            "multipliers": [[float(value.real), float(value.imag)] for value in cycle.multipliers],
            "trivial": cycle.trivial,
            "states": list(cycle.labels),
            "phase_s": cycle.time_s.tolist(),
            "phase_response_s": cycle.phase_response.tolist(),
        }
        for time, cycle in cycles.items()
    }


def _multiplier(value: complex) -> str:
    if abs(value) < _ROUNDING:
        return f"below {_ROUNDING:.0e}"
    if abs(value.imag) < _ROUNDING:
        return f"{value.real:.4g}"
    return f"{value.real:.3g} {'+' if np.sign(value.imag) > 0 else '-'} {abs(value.imag):.3g}i"
