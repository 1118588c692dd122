"""Tables in the terminal: a run's numbers, runs side by side, presets and arenas."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich import box
from rich.table import Table

from annelid.analysis.comparison import LACKING, Comparison, Number, relative_difference
from annelid.analysis.gait import Gait
from annelid.analysis.paper import (
    ELONGATION_WITHIN,
    FORMULATION,
    SPREAD,
    Published,
    agreement,
    changed_fields,
    formulation,
    references,
    stands_for_the_papers,
)
from annelid.analysis.summary import Summary
from annelid.config import field_value, fields_of, toml_value
from annelid.errors import listed, shortened

if TYPE_CHECKING:
    from annelid.config import RunConfig

UNKNOWN = "-"
MOST_CHARACTERS = 400
"""Of a value in a table of fields; a scene has up to a million."""
_ONSETS_SHOWN = 12
COMPARED = ("reference", "deviation")  # headings of what stands beside our numbers
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

GAIT_ROWS: dict[str, Row] = {
    "slip_ratio": ("slip ratio", 100.0, 1, "%"),
    "backward_ratio": ("travel backwards", 100.0, 1, "%"),
    "cost_of_transport": ("cost of transport, positive work", 1.0, 2, ""),
    "cost_of_transport_net": ("cost of transport, net work", 1.0, 2, ""),
    "lateral_drift": ("drift to the left per travel", 100.0, 1, "%"),
}
"""The same of the gait."""

COMPARISON_ROWS: dict[str, Row] = {
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
"""The same of a comparison."""


def framed_table(*headings: str, title: str | None = None, caption: str | None = None, min_width: int = 0) -> Table:
    """Returns an empty table in the project's look, whose long words go on in the next line.

    Args:
        headings: Of its columns.
        title: Above it, bold.
        caption: Below it.
        min_width: Least width, characters.
    """
    table = Table(
        *headings,
        title=title,
        title_justify="left",
        title_style="bold",
        caption=caption,
        caption_justify="left",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        min_width=min_width,
    )
    for column in table.columns:
        column.overflow = "fold"
    return table


def summary_table(
    numbers: Summary, config: RunConfig, locomotion: Gait | None = None, moved: Callable[[str], str] | None = None
) -> Table:
    """Returns a run's numbers as a table for the terminal, those to compare with beside them, perhaps with its gait.

    Rows without a number are left out, unless there is one to compare with. A column says how far each moves in finer
    runs where a function of its field says that.
    """
    compared = COMPARED if references(config) else ()
    duration = "" if numbers.duration_s is None else f", {numbers.duration_s:g} s"
    title = f"{numbers.name}: {numbers.n_segments} segments{duration}, {numbers.status.replace('_', ' ')}"
    caption = legend(numbers, config) if compared else None
    checked = () if moved is None else ("moves by",)
    table = framed_table("quantity", "this run", *checked, *compared, title=title, caption=caption)
    for column, narrowest in zip(table.columns, (12, 16), strict=False):
        column.min_width = narrowest

    def said(field: str) -> tuple[str, ...]:
        return () if moved is None else (moved(field),)

    for field, (label, ours, *beside) in _rows_by_field(numbers, config).items():
        table.add_row(label, ours, *said(field), *beside[: len(compared)])
    if locomotion is not None:
        table.add_section()
        for field, row in _gait_rows_by_field(locomotion).items():
            table.add_row(*row, *said(field))
    return table


def gait_rows(numbers: Gait) -> list[tuple[str, str]]:
    """Returns label and value of every number that a gait has."""
    return list(_gait_rows_by_field(numbers).values())


def _gait_rows_by_field(numbers: Gait) -> dict[str, tuple[str, str]]:
    rows: dict[str, tuple[str, str]] = {}
    if numbers.speed_m_per_s is not None and numbers.stride_m is not None:
        lengths = numbers.speed_body_lengths_per_s, numbers.stride_body_lengths
        speed, stride = (f" ({x:.3f} body lengths)" if x is not None else "" for x in lengths)
        of_cycles = f"speed, {numbers.cycles} cycle{'' if numbers.cycles == 1 else 's'}"
        rows["speed_m_per_s"] = (of_cycles, f"{100 * numbers.speed_m_per_s:.2f} cm/s{speed.replace(')', '/s)')}")
        rows["stride_m"] = ("stride", f"{100 * numbers.stride_m:.1f} cm{stride}")
    values: dict[str, Row] = {"contact_duty": ("on the ground", 100.0, 0, "%"), **GAIT_ROWS}
    rows |= {field: (row[0], quantity(getattr(numbers, field), *row[1:])) for field, row in values.items()}
    if numbers.turning_radius_m is not None:
        side = "left" if numbers.turning_radius_m > 0 else "right"
        rows["turning_radius_m"] = ("turning radius", f"{abs(numbers.turning_radius_m):.2f} m to the {side}")
    if (energy := numbers.energy) is not None:
        rows["energy_muscle_work_J"] = ("muscles' net work, whole run", f"{energy.muscle_work_J:.2f} J")
        parts = {
            "stored": energy.kinetic_J + energy.elastic_J + (energy.potential_J or 0.0),
            "slip": energy.slip_J,
            "other constraints": energy.constraints_J,
            "damping": energy.damping_J,
            "integrator": energy.numerical_J,
        }
        if energy.muscle_work_J > 0:
            shares = (f"{n} {100 * part / energy.muscle_work_J:.0f} %" for n, part in parts.items() if part is not None)
            rows["energy"] = ("of which", ", ".join(shares))
    return {field: row for field, row in rows.items() if row[1] != UNKNOWN}


def comparison_table(comparison: Comparison) -> Table:
    """Returns the numbers of runs side by side; below each but the first run's, the difference to it."""
    caption = f"in brackets: difference to {comparison.labels[0]}; pp: peak to peak"
    table = _side_by_side("quantity", comparison.labels, caption)
    table.add_row("status", *(status.replace("_", " ") for status in comparison.statuses))
    table.add_row("order of contractions", *map(_first_of_order, comparison.orders))
    for field, row in COMPARISON_ROWS.items():
        values = comparison.numbers.get(field, ())
        if any(value is not None for value in values):
            shares = (_percents(share, lambda percent: f"{percent:+.1f}") for share in comparison.differences(field))
            below = (f"\n({share})" if share else "" for share in shares)
            table.add_row(row[0], *(quantity(v, *row[1:]) + more for v, more in zip(values, below, strict=True)))
    return table


def fields_table(comparison: Comparison) -> Table:
    """Returns the fields in which the configurations differ; of worms of different kinds only those that all have."""
    other_kinds = "body.kind" in comparison.fields
    caption = "worms of different kinds: of body and arena only fields that all have; --json lists all"
    table = _side_by_side("field of the configuration", comparison.labels, caption if other_kinds else None)
    for field, values in comparison.fields.items():
        if not (other_kinds and field.startswith(("body.", "arena.")) and LACKING in values):
            table.add_row(field, *(UNKNOWN if value is LACKING else _setting(value) for value in values))
    return table


def summary_rows(
    numbers: Summary, config: RunConfig, only: Collection[str] = ("order", "wave", *SUMMARY_ROWS)
) -> list[tuple[str, str, str, str]]:
    """Returns label, our number, the one to compare with and the deviation of every row in which there is a number."""
    return [row for field, row in _rows_by_field(numbers, config).items() if field in only]


def _rows_by_field(numbers: Summary, config: RunConfig) -> dict[str, tuple[str, str, str, str]]:
    beside = references(config)
    pairs = list(zip(numbers.order, numbers.onsets_s, strict=True))
    onsets = ", ".join(f"{segment} at {time:.2f}" for segment, time in pairs[:_ONSETS_SHOWN])
    more = f", and {len(pairs) - _ONSETS_SHOWN} more" if len(pairs) > _ONSETS_SHOWN else ""
    cycles = f"{numbers.full_cycles} full cycle{'' if numbers.full_cycles == 1 else 's'}"
    wave = f"yes, {cycles}" if numbers.wave else "too short to judge" if numbers.wave is None else f"no ({cycles})"
    cells = [("segment at onset (s)", onsets + more or "none", "order"), ("wave 1-2-..-N", wave, "wave")]
    # A planar worm has one sensor per segment, and no name for it.
    sensor = f", {config.body.first_sensor}" if config.body.first_sensor else ""
    for field, row in SUMMARY_ROWS.items():
        if sensor or ", mean" not in row[0]:
            text = quantity(getattr(numbers, field), *row[1:])
            if field == "period_s" and numbers.period_std_s is not None:
                text += f" (std {numbers.period_std_s:.3f} s)"
            cells.append((row[0].replace(", first helix", sensor), text, field))
    rows = {
        field: (label, ours, _theirs(field, beside.get(field)), _deviation(field, numbers, beside.get(field)))
        for label, ours, field in cells
    }
    return {field: row for field, row in rows.items() if row[1] != UNKNOWN or row[2]}


def _deviation(field: str, numbers: Summary, entry: Published | None) -> str:
    """By how many percent our number, or that of each segment, is above the one to compare with.

    Empty for shares, speeds of computing and words, for the range over sensors, and where either number is lacking.
    """
    if entry is None or field in SPREAD or isinstance(entry.value, str) or SUMMARY_ROWS[field][-1] in ("%", ""):
        return ""
    return _percents(relative_difference(entry.value, getattr(numbers, field)), _signed)


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
        said += [_about_rigid_crossings(numbers)] if config.body.has_rigid_crossings else []
    return " ".join(said)


def closing_sentence(numbers: Summary, config: RunConfig) -> str:
    """Says what is changed of a preset, or whether a run reproduces the paper's own formulation; else nothing."""
    if not references(config):
        return ""
    preset, changed = changed_fields(config)
    if changed:
        return f"this run differs from {preset} in {listed(changed)}: the references are those of the unchanged worm"
    if not stands_for_the_papers(config) or config.body.has_rigid_crossings or numbers.status != "complete":
        return ""
    found = agreement(numbers)
    within = f"{100 * ELONGATION_WITHIN:g} %"
    if found:
        return (
            f"{config.name} reproduces order, period and mean elongation of the paper's formulation within {within}; "
            f"next: {NEXT}"
        )
    order, theirs = ("-".join(map(str, one.order)) or "none" for one in (numbers, formulation()))
    apart = [] if found.order else [f"order {order} in place of {theirs}"]
    apart += [] if found.period_agrees else [f"period {_percents(found.period, _signed) or 'unknown'}"]
    apart += [
        f"mean elongation of segment {segment} {_percents(share, _signed) or 'unknown'}"
        for segment, (share, agrees) in enumerate(zip(found.elongation, found.elongation_agrees, strict=True), start=1)
        if not agrees
    ]
    return f"{config.name} does not reproduce the paper's formulation within {within}: {', '.join(apart)}; next: {NEXT}"


def presets_table(presets: Sequence[RunConfig]) -> Table:
    """Lists configurations: name, summary, segments and simulated time."""
    rows = ((c.name, c.summary, str(c.body.n_segments), f"{c.duration_s:g} s") for c in presets)
    return _list(("preset", "what it is", "segments", "simulated"), rows)


def arenas_table(summaries: Mapping[str, str]) -> Table:
    """Lists arenas, their names and summaries."""
    return _list(("arena", "what it is"), summaries.items())


def field_lines(config: RunConfig) -> list[str]:
    """Returns one line for every field of a configuration: path, value as TOML writes it, and what it means."""
    lines = []
    for path, meaning in fields_of(config).items():
        value = field_value(config, path)
        setting = f"{path} (not set)" if value is None else f"{path} = {toml_value(value)}"
        lines.append(f"{setting:<60}{'  # ' if meaning else ''}{meaning}".rstrip())
    return lines


def _list(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    table = Table(*headings, box=None, pad_edge=False)
    for row in rows:
        table.add_row(*row)
    return table


def _side_by_side(first: str, labels: Sequence[str], caption: str | None) -> Table:
    table = framed_table(first, *labels, caption=caption)
    for column in table.columns[1:]:
        column.min_width = 10
    return table


def _theirs(field: str, entry: Published | None) -> str:
    if entry is None:
        return ""
    source = "" if entry.paper == FORMULATION else " [P]"
    if isinstance(entry.value, str):
        return f"{entry.value}{source}"
    return f"{quantity(entry.value, *SUMMARY_ROWS[field][1:])}{source}"


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
    theirs_give = f"{FORMULATION} has the paper's soft crossings, which part by up to {gap}"
    return f"Here crossings are rigid, and {times}: {theirs_give}."


def _first_of_order(order: Sequence[int]) -> str:
    if not order:
        return UNKNOWN
    more = f" and {len(order) - _ONSETS_SHOWN} more" if len(order) > _ONSETS_SHOWN else ""
    return "-".join(map(str, order[:_ONSETS_SHOWN])) + more


def _setting(value: Any) -> str:
    return "not set" if value is None else shortened(toml_value(value), MOST_CHARACTERS)


def _percents(shares: Number, form: Callable[[float], str]) -> str:
    """Writes a share, or one per segment, in percent; nothing where none is known."""
    each = shares if isinstance(shares, Sequence) else [shares]
    if all(share is None for share in each):
        return ""
    return f"{' / '.join(UNKNOWN if share is None else form(100 * share) for share in each)} %"


def _signed(percent: float) -> str:
    return f"{percent:+z.1f}" if abs(percent) < 9.95 else f"{percent:+.0f}"


def quantity(value: float | Sequence[float | None] | None, factor: float, digits: int, unit: str) -> str:
    """Writes a number, or one per segment: multiplied, rounded, with its unit; a dash for None."""
    if value is None:
        return UNKNOWN
    if isinstance(value, list | tuple):
        return f"{' / '.join(quantity(v, factor, digits, '') for v in value)} {unit}"
    assert isinstance(value, int | float)
    return f"{factor * value:z.{digits}f} {unit}".rstrip()
