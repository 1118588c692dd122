"""The rows of a run's table that say how the worm gets along and where its muscles' work went."""

from __future__ import annotations

from typing import TYPE_CHECKING

from annelid.analysis.gait import Gait
from annelid.draw.table import Row, quantity

if TYPE_CHECKING:
    from rich.table import Table

    from annelid.analysis.gait import EnergyBalance

GAIT_ROWS: dict[str, Row] = {
    "slip_ratio": ("slip ratio", 100.0, 1, "%"),
    "backward_ratio": ("centre of mass, way back", 100.0, 1, "%"),
    "cost_of_transport": ("cost of transport, positive work", 1.0, 2, ""),
    "cost_of_transport_net": ("cost of transport, net work", 1.0, 2, ""),
    "lateral_drift": ("drift to the left per way", 100.0, 1, "%"),
}
"""Field of the gait: what it is called, what it is multiplied by, digits, unit."""


def add_gait(table: Table, numbers: Gait) -> None:
    """Adds the rows that can be told as a section of their own.

    Args:
        table: The run's table; its first column is the quantity, its second this run's number.
        numbers: The gait.
    """
    rows = gait_rows(numbers)
    if not rows:
        return
    table.add_section()
    for row in rows:
        table.add_row(*row)


def gait_rows(numbers: Gait) -> list[tuple[str, str]]:
    """Returns label and value of every row that can be told."""
    rows: list[tuple[str, str]] = []
    if numbers.speed_m_per_s is not None and numbers.stride_m is not None:
        cycles = f"{numbers.cycles} cycle{'' if numbers.cycles == 1 else 's'}"
        lengths = numbers.speed_body_lengths_per_s, numbers.stride_body_lengths
        speed, stride = (f" ({x:.3f} body lengths)" if x is not None else "" for x in lengths)
        rows.append((f"speed, {cycles}", f"{100 * numbers.speed_m_per_s:.2f} cm/s{speed.replace(')', '/s)')}"))
        rows.append(("stride", f"{100 * numbers.stride_m:.1f} cm{stride}"))
    if numbers.contact_duty is not None:
        rows.append(("on the ground", f"{' / '.join(f'{100 * share:.0f}' for share in numbers.contact_duty)} %"))
    for field, (label, factor, digits, unit) in GAIT_ROWS.items():
        value = getattr(numbers, field)
        if value is not None:
            rows.append((label, quantity(value, factor, digits, unit)))
    if numbers.turning_radius_m is not None:
        side = "left" if numbers.turning_radius_m > 0 else "right"
        rows.append(("turning radius", f"{abs(numbers.turning_radius_m):.2f} m to the {side}"))
    if numbers.energy is not None:
        rows.append(("muscles' net work, whole run", f"{numbers.energy.muscle_work_J:.2f} J"))
        rows.extend(_shares(numbers.energy))
    return rows


def _shares(balance: EnergyBalance) -> list[tuple[str, str]]:
    """Where the work went, in shares of it; nothing if there was next to none."""
    if not balance.muscle_work_J > 0:
        return []
    held = balance.kinetic_J + balance.elastic_J + (balance.potential_J or 0.0)
    parts = (
        ("held", held),
        ("slip", balance.slip_J),
        ("other constraints", balance.constraints_J),
        ("damping", balance.damping_J),
        ("integrator", balance.numerical_J),
    )
    shares = [f"{name} {100 * part / balance.muscle_work_J:.0f} %" for name, part in parts if part is not None]
    return [("of which", ", ".join(shares))]
