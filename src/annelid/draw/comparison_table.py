"""Runs side by side in the terminal: numbers with their differences, and the fields in which configurations differ."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from annelid.analysis.comparison import Comparison, Number
from annelid.config import toml_value
from annelid.draw.gait_table import GAIT_ROWS
from annelid.draw.table import SUMMARY_ROWS, UNKNOWN, Row, quantity

if TYPE_CHECKING:
    from rich.table import Table

_ORDER_SHOWN = 12
ROWS: dict[str, Row] = {
    "duration_s": ("simulated time", 1.0, 3, "s"),
    **SUMMARY_ROWS,
    "gait.speed_m_per_s": ("speed", 100.0, 2, "cm/s"),
    "gait.speed_body_lengths_per_s": ("speed", 1.0, 3, "body lengths/s"),
    "gait.stride_m": ("stride", 100.0, 1, "cm"),
    "gait.contact_duty": ("on the ground", 100.0, 0, "%"),
    **{f"gait.{field}": row for field, row in GAIT_ROWS.items()},
    "gait.turning_radius_m": ("turning radius, left positive", 1.0, 2, "m"),
    "gait.energy.muscle_work_J": ("muscles' net work, whole run", 1.0, 2, "J"),
    "gait.energy.slip_J": ("lost to slip, whole run", 1.0, 2, "J"),
}
"""Field of the comparison: what it is called, what it is multiplied by, digits, unit."""


def comparison_table(comparison: Comparison) -> Table:
    """Lays the numbers side by side; below each but the first run's, the difference to it.

    Returns:
        A rich table; rows that no run can tell are left out.
    """
    table = _table("quantity", comparison.labels)
    table.add_row("status", *(status.replace("_", " ") for status in comparison.statuses))
    table.add_row("order of contractions", *map(_order, comparison.orders))
    for field, (label, factor, digits, unit) in ROWS.items():
        values = comparison.numbers.get(field, ())
        if any(value is not None for value in values):
            shares = comparison.differences(field)
            cells = (_cell(quantity(v, factor, digits, unit), share) for v, share in zip(values, shares, strict=True))
            table.add_row(label, *cells)
    table.caption = f"in brackets: difference to {comparison.labels[0]}; pp: peak to peak"
    table.caption_justify = "left"
    return table


def fields_table(comparison: Comparison) -> Table:
    """Lists the fields in which the configurations differ.

    Where the kinds of worm differ, so do most fields of body and arena; these are left out.
    """
    table = _table("field of the configuration", comparison.labels)
    other_kinds = "body.kind" in comparison.fields
    for field, values in comparison.fields.items():
        if other_kinds and field.startswith(("body.", "arena.")) and not _shared(field, comparison):
            continue
        lacks = comparison.lacking[field]
        table.add_row(field, *(_value(value, lack) for value, lack in zip(values, lacks, strict=True)))
    if other_kinds:
        table.caption = "worms of different kinds: of body and arena only fields that all have; --json lists all"
        table.caption_justify = "left"
    return table


def _table(first: str, labels: Sequence[str]) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column(first, overflow="fold")
    for label in labels:
        table.add_column(label, overflow="fold", min_width=10)
    return table


def _shared(field: str, comparison: Comparison) -> bool:
    return not any(comparison.lacking[field])


def _order(order: Sequence[int]) -> str:
    if not order:
        return UNKNOWN
    more = f" and {len(order) - _ORDER_SHOWN} more" if len(order) > _ORDER_SHOWN else ""
    return "-".join(map(str, order[:_ORDER_SHOWN])) + more


def _cell(text: str, share: Number) -> str:
    shares = list(_percents(share))
    return f"{text}\n({' / '.join(shares)} %)" if any(word != UNKNOWN for word in shares) else text


def _percents(share: Number) -> Iterator[str]:
    for one in share if isinstance(share, Sequence) else [share]:
        yield UNKNOWN if one is None else f"{100 * one:+.1f}"


def _value(value: Any, lacks: bool) -> str:
    if lacks:
        return UNKNOWN
    return "not set" if value is None else toml_value(value)
