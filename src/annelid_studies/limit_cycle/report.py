"""A limit cycle as a table, and as numbers for JSON."""

from __future__ import annotations

from typing import Any

from rich.table import Table

from annelid_studies.limit_cycle.cycle import LimitCycle

_MULTIPLIERS_SHOWN = 4
# A smaller multiplier is lost in products of rounded matrices.
_ROUNDING = 1e-12


def cycle_table(name: str, cycle: LimitCycle) -> Table:
    """Returns a limit cycle with its largest multipliers."""
    caption = "A multiplier is what one cycle leaves of a small deviation; the one at 1 is a shift along the cycle."
    title = f"{name}: limit cycle in {len(cycle.labels)} states"
    # Title and caption would fold.
    table = Table("quantity", "", title=title, caption=caption, box=None, min_width=72)
    table.add_row("period (ms)", f"{1e3 * cycle.period_s:.2f}")
    for i, multiplier in enumerate(cycle.multipliers[:_MULTIPLIERS_SHOWN], start=1):
        table.add_row(f"multiplier {i}", _multiplier(multiplier))
    table.add_row("orbit closes within", f"{cycle.closing_error:.0e} of a size")
    return table


def cycle_numbers(cycle: LimitCycle) -> dict[str, Any]:
    """Returns the same numbers for JSON: multipliers as pairs of real and imaginary part, times in s."""
    return {
        "period_s": cycle.period_s,
        "closing_error": cycle.closing_error,
        "multipliers": [[float(value.real), float(value.imag)] for value in cycle.multipliers],
        "trivial": cycle.trivial,
        "states": list(cycle.labels),
        "phase_s": cycle.time_s.tolist(),
        "phase_response_s": cycle.phase_response.tolist(),
    }


def _multiplier(value: complex) -> str:
    if abs(value) < _ROUNDING:
        return f"below {_ROUNDING:.0e}"
    if abs(value.imag) < _ROUNDING:
        return f"{value.real:.4g}"
    return f"{value.real:.3g} {'+' if value.imag > 0 else '-'} {abs(value.imag):.3g}i"
