"""The table that ends a run: our numbers, what each is compared with where there is such, and what follows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from annelid.analysis.comparison import relative_difference
from annelid.analysis.paper import (
    ELONGATION_WITHIN,
    FORMULATION,
    SPREAD,
    Published,
    agreement,
    changed_fields,
    formulation,
    has_rigid_crossings,
    references,
    stands_for_the_papers,
)
from annelid.analysis.summary import Summary
from annelid.config import WormBody, field_value, fields_of, toml_value
from annelid.errors import listed

if TYPE_CHECKING:
    from rich.table import Table

    from annelid.config import RunConfig

UNKNOWN = "-"
_ONSETS_SHOWN = 12
_NARROWEST, _NARROWEST_OURS = 12, 16

COMPARED = ("reference", "deviation")
"""Headings of what stands beside our numbers."""

NEXT = (
    f"annelid run {FORMULATION} (that formulation itself, a minute), "
    "riddle2023-rods (rigid crossings), wang (the robot)"
)
"""What to run after the first worm."""

Row = tuple[str, float, int, str]
SUMMARY_ROWS: dict[str, Row] = {
    "period_s": ("period", 1.0, 3, "s"),
    "elongation_first_helix_pp_m": ("elongation, first helix, pp", 100.0, 2, "cm"),
    "elongation_least_pp_m": ("least of its sensors, pp", 100.0, 2, "cm"),
    "elongation_most_pp_m": ("most of its sensors, pp", 100.0, 2, "cm"),
    "elongation_mean_max_m": ("elongation, mean, maximum", 100.0, 2, "cm"),
    "middle_deficit": ("middle below first, pp", 100.0, 1, "%"),
    "middle_deficit_mean": ("middle below first, mean", 100.0, 1, "%"),
    "end_difference": ("last below first, pp", 100.0, 1, "%"),
    "contraction_force_median_N": ("force contracted, median", 1.0, 2, "N"),
    "contraction_force_peak_N": ("force contracted, peak", 1.0, 2, "N"),
    "segment_force_median_N": ("of each segment, median", 1.0, 2, "N"),
    "segment_force_peak_N": ("of each segment, peak", 1.0, 2, "N"),
    "positive_work_J": ("positive work of each segment", 1.0, 2, "J"),
    "muscle_work_J": ("net work of each segment", 1.0, 2, "J"),
    "travel_m": ("travel forwards, centre of mass", 1000.0, 1, "mm"),
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
        A rich table; rows whose number cannot be told are left out, unless there is one to compare with.
    """
    from rich import box
    from rich.table import Table

    beside = bool(references(config))
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
    for heading in COMPARED if beside else ():
        table.add_column(heading, overflow="fold")
    for label, ours, *compared in summary_rows(numbers, config):
        table.add_row(label, ours, *(compared if beside else []))
    if beside:
        table.caption = legend(numbers, config)
        table.caption_justify = "left"
    return table


def summary_rows(numbers: Summary, config: RunConfig) -> list[tuple[str, str, str, str]]:
    """Returns label, our number, the one to compare with and the deviation of every row in which there is a number."""
    beside = references(config)
    first_sensor = config.body.springs.first_sensor if isinstance(config.body, WormBody) else None
    rows = [
        (label, ours, _theirs(field, beside.get(field)), deviation(field, numbers, beside.get(field)))
        for label, ours, field in _cells(numbers, first_sensor)
    ]
    return [row for row in rows if row[1] != UNKNOWN or row[2]]


def deviation(field: str, numbers: Summary, entry: Published | None) -> str:
    """Returns by how many percent our number, or that of each segment, is above the one to compare with.

    Returns:
        Empty for shares, speeds of computing and words, for the range over sensors, and where either number is lacking.
    """
    if entry is None or field in SPREAD or isinstance(entry.value, str) or SUMMARY_ROWS[field][-1] in ("%", ""):
        return ""
    shares = relative_difference(entry.value, getattr(numbers, field))
    if shares is None:
        return ""
    of_each = shares if isinstance(shares, Sequence) else [shares]
    return f"{' / '.join(UNKNOWN if share is None else _signed(100 * share) for share in of_each)} %"


def legend(numbers: Summary, config: RunConfig) -> str:
    """Says where the numbers to compare with come from; empty where there are none."""
    beside = references(config)
    if not beside:
        return ""
    places = ", ".join(dict.fromkeys(entry.place for entry in beside.values() if entry.paper != FORMULATION))
    paper = next(entry.paper for entry in beside.values() if entry.paper != FORMULATION)
    said = [f"pp: peak to peak. [P]: published, {paper}, {places}."]
    if stands_for_the_papers(config):
        said.append(f"Other references: {FORMULATION}, the paper's own formulation.")
        said += [_about_rigid_crossings(numbers)] if has_rigid_crossings(config) else []
    return " ".join(said)


def closing_sentence(numbers: Summary, config: RunConfig) -> str:
    """Says whether a run reproduces the paper's own formulation, or by how much it does not.

    Args:
        numbers: The run's numbers.
        config: Its configuration.

    Returns:
        One sentence, where a preset is changed on what is changed; empty where there is nothing to compare with.
    """
    if not references(config) or not isinstance(config.body, WormBody):
        return ""
    changed = changed_fields(config)
    if changed:
        return (
            f"this run differs from {config.name} in {listed(changed)}: the references are those of the unchanged worm"
        )
    if not stands_for_the_papers(config) or has_rigid_crossings(config) or numbers.status != "complete":
        return ""
    found = agreement(numbers)
    within = f"{100 * ELONGATION_WITHIN:g} %"
    if found:
        return (
            f"{config.name} reproduces order, period and elongation of the paper's formulation within {within}; "
            f"next: {NEXT}"
        )
    apart = [] if found.order else [f"order {_order(numbers)} in place of {_order(formulation())}"]
    apart += [] if found.period_agrees else [f"period {_share(found.period)}"]
    apart += [
        f"elongation of segment {segment} {_share(share)}"
        for segment, (share, agrees) in enumerate(zip(found.elongation, found.elongation_agrees, strict=True), start=1)
        if not agrees
    ]
    return f"{config.name} does not reproduce the paper's formulation within {within}: {', '.join(apart)}; next: {NEXT}"


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
    source = "" if entry.paper == FORMULATION else " [P]"
    if isinstance(entry.value, str):
        return f"{entry.value}{source}"
    _, factor, digits, unit = SUMMARY_ROWS[field]
    return f"{quantity(entry.value, factor, digits, unit)}{source}"


def _about_rigid_crossings(numbers: Summary) -> str:
    theirs = formulation()
    shares = relative_difference(theirs.elongation_mean_max_m, numbers.elongation_mean_max_m)
    known = [1.0 + share for share in shares if share is not None] if isinstance(shares, Sequence) else []
    times = (
        f"a segment elongates {sum(known) / len(known):.1f} times as far"
        if known and numbers.period_s
        else "segments elongate farther"
    )
    gap = f"{1e3 * (theirs.pin_gap_max_m or 0.0):.0f} mm"
    return f"Here crossings are rigid, and {times}: {FORMULATION} has the paper's soft pins, which part by up to {gap}."


def _order(numbers: Summary) -> str:
    return "-".join(map(str, numbers.order)) or "none"


def _share(share: float | None) -> str:
    return "unknown" if share is None else f"{_signed(100 * share)} %"


def _signed(percent: float) -> str:
    return f"{percent:+z.1f}" if abs(percent) < 9.95 else f"{percent:+.0f}"


def quantity(value: float | Sequence[float | None] | None, factor: float, digits: int, unit: str) -> str:
    """Returns a number, or one a segment, as a row says: multiplied, rounded, with its unit; a dash for None."""
    if value is None:
        return UNKNOWN
    if isinstance(value, list | tuple):
        return f"{' / '.join(quantity(v, factor, digits, '') for v in value)} {unit}"
    assert isinstance(value, int | float)
    return f"{factor * value:z.{digits}f} {unit}".rstrip()
