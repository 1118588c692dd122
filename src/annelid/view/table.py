"""The table that ends a run: our numbers, and beside each the published one where there is one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from annelid.analysis.paper import Published, published
from annelid.analysis.summary import Summary
from annelid.config import WormBody, field_value, fields_of, toml_value

if TYPE_CHECKING:
    from rich.table import Table

    from annelid.config import RunConfig

UNKNOWN = "-"
_ONSETS_SHOWN = 12
_NARROWEST, _NARROWEST_OURS = 12, 16

Row = tuple[str, float, int, str]
SUMMARY_ROWS: dict[str, Row] = {
    "period_s": ("period", 1.0, 3, "s"),
    "elongation_first_helix_pp_m": ("elongation, first helix, pp", 100.0, 2, "cm"),
    "elongation_mean_max_m": ("elongation, mean, maximum", 100.0, 2, "cm"),
    "middle_deficit": ("middle below first, pp", 100.0, 1, "%"),
    "middle_deficit_mean": ("middle below first, mean", 100.0, 1, "%"),
    "end_difference": ("last below first, pp", 100.0, 1, "%"),
    "contraction_force_median_N": ("force contracted, median", 1.0, 2, "N"),
    "contraction_force_peak_N": ("force contracted, peak", 1.0, 2, "N"),
    "segment_force_median_N": ("of each segment, median", 1.0, 2, "N"),
    "segment_force_peak_N": ("of each segment, peak", 1.0, 2, "N"),
    "muscle_work_J": ("work of each segment", 1.0, 2, "J"),
    "travel_m": ("travel, centre of mass", 1000.0, 1, "mm"),
    "travel_path_m": ("travel, forth and back", 1000.0, 1, "mm"),
    "ring_length_min_m": ("shortest ring", 100.0, 1, "cm"),
    "edge_strain_max": ("largest edge strain", 100.0, 3, "%"),
    "pin_gap_max_m": ("largest pin gap", 1000.0, 2, "mm"),
    "real_time_factor": ("times real time", 1.0, 3, ""),
}
"""Field of the summary: what it is called, what it is multiplied by, digits, unit."""


def summary_table(numbers: Summary, config: RunConfig) -> Table:
    """Lays out a run's summary as a table for the terminal.

    Args:
        numbers: The summary.
        config: The configuration it belongs to, which decides what it is compared with.

    Returns:
        A rich table; rows whose number cannot be told are left out, unless one has been published.
    """
    from rich import box
    from rich.table import Table

    beside = published(config)
    duration = "" if numbers.duration_s is None else f", {numbers.duration_s:g} s"
    table = Table(
        title=f"{numbers.name}: {numbers.n_segments} segments{duration}, {numbers.status.replace('_', ' ')}",
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
    )
    table.add_column("quantity", min_width=_NARROWEST, overflow="fold")
    table.add_column("this run", min_width=_NARROWEST_OURS, overflow="fold")
    if beside:
        table.add_column("published", overflow="fold")
    for label, ours, theirs in summary_rows(numbers, config):
        table.add_row(label, ours, *([theirs] if beside else []))
    if beside:
        table.caption = legend(config)
        table.caption_justify = "left"
    return table


def summary_rows(numbers: Summary, config: RunConfig) -> list[tuple[str, str, str]]:
    """Returns label, our number and the published one of every row in which there is either, each with its unit."""
    beside = published(config)
    first_sensor = config.body.springs.first_sensor if isinstance(config.body, WormBody) else None
    rows = [(label, ours, _theirs(field, beside.get(field))) for label, ours, field in _cells(numbers, first_sensor)]
    return [row for row in rows if row[1] != UNKNOWN or row[2]]


def legend(config: RunConfig) -> str:
    """Says where the published numbers of a configuration stand; empty where there are none."""
    beside = published(config)
    places = ", ".join(dict.fromkeys(entry.place for entry in beside.values()))
    return f"pp: peak to peak. published: {next(iter(beside.values())).paper}, {places}" if beside else ""


def presets_table(presets: Sequence[RunConfig]) -> Table:
    """Lists configurations: name, summary, segments and simulated time."""
    from rich.table import Table

    table = Table("preset", "what it is", "segments", "simulated", box=None, pad_edge=False)
    for config in presets:
        table.add_row(config.name, config.summary, str(config.body.n_segments), f"{config.duration_s:g} s")
    return table


def arenas_table(summaries: Mapping[str, str]) -> Table:
    """Lists arenas, their names and summaries."""
    from rich.table import Table

    table = Table("arena", "what it is", box=None, pad_edge=False)
    for name, summary in summaries.items():
        table.add_row(name, summary)
    return table


def field_lines(config: RunConfig) -> list[str]:
    """Returns one line for every field of a configuration: path, value as TOML writes it, and what it means."""
    lines = []
    for path, meaning in fields_of(config).items():
        value = field_value(config, path)
        setting = f"{path} = {toml_value(value)}" if value is not None else f"{path} (not set)"
        lines.append(f"{setting:<60}{'  # ' if meaning else ''}{meaning}".rstrip())
    return lines


def _cells(numbers: Summary, first_sensor: str | None) -> list[tuple[str, str, str]]:
    """Label, our value and field of every row. A planar worm has one sensor a segment, and no name for it."""
    cells = [
        ("segment at onset (s)", _onsets(numbers), "order"),
        ("wave 1-2-..-N", _wave(numbers), "wave"),
    ]
    for field, (label, factor, digits, unit) in SUMMARY_ROWS.items():
        if first_sensor is None and ", mean" in label:
            continue
        label = label.replace(", first helix", f", {first_sensor}" if first_sensor else "")
        text = quantity(getattr(numbers, field), factor, digits, unit)
        if field == "period_s" and numbers.period_std_s is not None:
            text += f" (std {numbers.period_std_s:.3f} s)"
        cells.append((label, text, field))
    return cells


def _onsets(numbers: Summary) -> str:
    pairs = list(zip(numbers.order, numbers.onsets_s, strict=True))
    shown = ", ".join(f"{segment} at {time:.2f}" for segment, time in pairs[:_ONSETS_SHOWN])
    more = f", and {len(pairs) - _ONSETS_SHOWN} more" if len(pairs) > _ONSETS_SHOWN else ""
    return shown + more if pairs else "none"


def _wave(numbers: Summary) -> str:
    if numbers.wave is None:
        return "too short to tell"
    cycles = f"{numbers.full_cycles} full cycle{'' if numbers.full_cycles == 1 else 's'}"
    return f"yes, {cycles}" if numbers.wave else f"no ({cycles})"


def _theirs(field: str, entry: Published | None) -> str:
    if entry is None:
        return ""
    if isinstance(entry.value, str):
        return entry.value
    _, factor, digits, unit = SUMMARY_ROWS[field]
    return quantity(entry.value, factor, digits, unit)


def quantity(value: float | Sequence[float | None] | None, factor: float, digits: int, unit: str) -> str:
    """Returns a number, or one a segment, as a row says: multiplied, rounded, with its unit; a dash for None."""
    if value is None:
        return UNKNOWN
    if isinstance(value, list | tuple):
        return f"{' / '.join(quantity(v, factor, digits, '') for v in value)} {unit}"
    assert isinstance(value, int | float)
    return f"{factor * value:z.{digits}f} {unit}".rstrip()
