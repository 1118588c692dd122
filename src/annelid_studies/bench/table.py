"""The benchmark as a table for the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.table import Table


def bench_table(report: Mapping[str, Any]) -> Table:
    """Lays out the cases of a benchmark, one a row.

    Args:
        report: The content of ``bench.json``.
    """
    from rich.table import Table

    references = list(report["fronts"])
    table = Table(title=f"{report['machine']}, recording on")
    table.add_column("case", overflow="fold")
    for heading in ("ms a step", "x real time", "memory, MB", *(f"error, %, against {name}" for name in references)):
        table.add_column(heading, justify="right")
    for entry in report["cases"]:
        table.add_row(*_row(entry, references))
    peer = report["peer"] or {}
    if peer.get("real_time_factor"):
        table.add_row(f"PyElastica, {peer['rods']} free rods", *_numbers(peer), "")
    elif peer:
        table.add_row("PyElastica", peer.get("failed") or "not installed")
        if "install" in peer:
            table.caption = f"for the peer: {peer['install']}"
    return table


def _row(entry: Mapping[str, Any], references: Sequence[str]) -> list[str]:
    name = f"{entry['name']} ({entry['level']})" if entry["level"] else entry["name"]
    if "failed" in entry:
        return [name, f"failed: {entry['failed']}"]
    compared = entry.get("errors", {})
    cells = [_percent(compared[reference]["largest"]) if reference in compared else "" for reference in references]
    if cells and compared and entry["rhythm"]["verdict"] != "ordered":
        name = f"{name}: {entry['rhythm']['reason']}"
    return [name, *_numbers(entry), _shown(entry["peak_memory_MB"], ".0f"), *cells]


def _numbers(entry: Mapping[str, Any]) -> list[str]:
    return [_shown(entry[key], ".3g") for key in ("step_mean_ms", "real_time_factor")]


def _percent(error: float | None) -> str:
    return _shown(None if error is None else 100.0 * error, ".2f")


def _shown(value: float | None, digits: str) -> str:
    return "-" if value is None else format(value, digits)
