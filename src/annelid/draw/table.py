"""Tables in the terminal: a run's numbers, runs side by side, limit cycles, presets and arenas."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from annelid.analysis.comparison import Comparison, Number, relative_difference
from annelid.analysis.gait import Gait
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
from annelid.body.worm import WormBody
from annelid.config import field_value, fields_of, toml_value
from annelid.errors import listed

if TYPE_CHECKING:
    from rich.table import Table

    from annelid.analysis.gait import EnergyBalance
    from annelid.analysis.limit_cycle import LimitCycle
    from annelid.config import RunConfig

UNKNOWN = "-"
_ONSETS_SHOWN = 12

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

GAIT_ROWS: dict[str, Row] = {
    "slip_ratio": ("slip ratio", 100.0, 1, "%"),
    "backward_ratio": ("centre of mass, way back", 100.0, 1, "%"),
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

TIMES = {
    "continuous": "continuous time",
    "located": "own steps, sensors located",
    "stepped": "own steps",
}
"""Headings of limit cycles, by `annelid.analysis.limit_cycle.Time`."""
# Products of rounded matrices tell no smaller multiplier.
_ROUNDING = 1e-12


def framed_table(*headings: str, title: str | None = None, caption: str | None = None, min_width: int = 0) -> Table:
    """Returns an empty table in the project's look, whose long words go on in the next line."""
    from rich import box
    from rich.table import Table

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


def summary_table(numbers: Summary, config: RunConfig) -> Table:
    """Lays out a run's summary as a table for the terminal.

    Args:
        numbers: The summary.
        config: The configuration it belongs to, which decides what it is compared with.

    Returns:
        A rich table; rows whose number cannot be told are left out, unless there is one to compare with.
    """
    compared = COMPARED if references(config) else ()
    duration = "" if numbers.duration_s is None else f", {numbers.duration_s:g} s"
    title = f"{numbers.name}: {numbers.n_segments} segments{duration}, {numbers.status.replace('_', ' ')}"
    caption = legend(numbers, config) if compared else None
    table = framed_table("quantity", "this run", *compared, title=title, caption=caption)
    for column, narrowest in zip(table.columns, (12, 16), strict=False):
        column.min_width = narrowest
    for row in summary_rows(numbers, config):
        table.add_row(*row[: 2 + len(compared)])
    return table


def add_gait(table: Table, numbers: Gait) -> None:
    """Adds the gait's rows to a run's table, as a section of their own."""
    table.add_section()
    for row in gait_rows(numbers):
        table.add_row(*row)


def gait_rows(numbers: Gait) -> list[tuple[str, str]]:
    """Returns label and value of every row that can be told."""
    rows: list[tuple[str, str]] = []
    if numbers.speed_m_per_s is not None and numbers.stride_m is not None:
        lengths = numbers.speed_body_lengths_per_s, numbers.stride_body_lengths
        speed, stride = (f" ({x:.3f} body lengths)" if x is not None else "" for x in lengths)
        of_cycles = f"speed, {numbers.cycles} cycle{'' if numbers.cycles == 1 else 's'}"
        rows.append((of_cycles, f"{100 * numbers.speed_m_per_s:.2f} cm/s{speed.replace(')', '/s)')}"))
        rows.append(("stride", f"{100 * numbers.stride_m:.1f} cm{stride}"))
    if numbers.contact_duty is not None:
        rows.append(("on the ground", quantity(list(numbers.contact_duty), 100.0, 0, "%")))
    for field, row in GAIT_ROWS.items():
        value = getattr(numbers, field)
        if value is not None:
            rows.append((row[0], quantity(value, *row[1:])))
    if numbers.turning_radius_m is not None:
        side = "left" if numbers.turning_radius_m > 0 else "right"
        rows.append(("turning radius", f"{abs(numbers.turning_radius_m):.2f} m to the {side}"))
    if numbers.energy is not None:
        rows.append(("muscles' net work, whole run", f"{numbers.energy.muscle_work_J:.2f} J"))
        rows.extend(_shares(numbers.energy))
    return rows


def comparison_table(comparison: Comparison) -> Table:
    """Lays the numbers of runs side by side; below each but the first run's, the difference to it.

    Returns:
        A rich table; rows that no run can tell are left out.
    """
    caption = f"in brackets: difference to {comparison.labels[0]}; pp: peak to peak"
    table = _side_by_side("quantity", comparison.labels, caption)
    table.add_row("status", *(status.replace("_", " ") for status in comparison.statuses))
    table.add_row("order of contractions", *map(_first_of_order, comparison.orders))
    for field, row in COMPARISON_ROWS.items():
        values = comparison.numbers.get(field, ())
        if any(value is not None for value in values):
            shares = comparison.differences(field)
            cells = (_compared(quantity(v, *row[1:]), share) for v, share in zip(values, shares, strict=True))
            table.add_row(row[0], *cells)
    return table


def fields_table(comparison: Comparison) -> Table:
    """Lists the fields in which the configurations differ.

    Where the kinds of worm differ, so do most fields of body and arena; these are left out.
    """
    other_kinds = "body.kind" in comparison.fields
    caption = "worms of different kinds: of body and arena only fields that all have; --json lists all"
    table = _side_by_side("field of the configuration", comparison.labels, caption if other_kinds else None)
    for field, values in comparison.fields.items():
        lacks = comparison.lacking[field]
        if not (other_kinds and field.startswith(("body.", "arena.")) and any(lacks)):
            table.add_row(field, *(_setting(value, lack) for value, lack in zip(values, lacks, strict=True)))
    return table


def cycle_table(name: str, cycles: Mapping[str, LimitCycle], n_shown: int = 4) -> Table:
    """Lays out the limit cycles of one worm, one column for each way of taking time.

    Args:
        name: The worm.
        cycles: The cycles, by `annelid.analysis.limit_cycle.Time`.
        n_shown: Multipliers to show, the largest ones.
    """
    main = next(iter(cycles.values()))
    caption = "A multiplier is what one cycle leaves of a small deviation; the one at 1 is a shift along the cycle."
    if set(cycles) != {"continuous"}:
        caption += " In steps none is at 1: a shift by less than a step is not one along the cycle."
    title = f"{name}: limit cycle in {len(main.labels)} states"
    # Title and caption would fold where there is only one column.
    table = framed_table("quantity", *(TIMES[time] for time in cycles), title=title, caption=caption, min_width=72)
    table.add_row("period (ms)", *(f"{1e3 * cycle.period_s:.2f}" for cycle in cycles.values()))
    for i in range(min(n_shown, len(main.labels))):
        table.add_row(f"multiplier {i + 1}", *(_multiplier(cycle.multipliers[i]) for cycle in cycles.values()))
    table.add_row("orbit closes within", *(f"{cycle.closing_error:.0e} of a range" for cycle in cycles.values()))
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
    preset, changed = changed_fields(config)
    if changed:
        return f"this run differs from {preset} in {listed(changed)}: the references are those of the unchanged worm"
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
        setting = f"{path} = {toml_value(value)}" if value is not None else f"{path} (not set)"
        lines.append(f"{setting:<60}{'  # ' if meaning else ''}{meaning}".rstrip())
    return lines


def _list(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    from rich.table import Table

    table = Table(*headings, box=None, pad_edge=False)
    for row in rows:
        table.add_row(*row)
    return table


def _side_by_side(first: str, labels: Sequence[str], caption: str | None) -> Table:
    table = framed_table(first, *labels, caption=caption)
    for column in table.columns[1:]:
        column.min_width = 10
    return table


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


def _compared(text: str, share: Number) -> str:
    shares = share if isinstance(share, Sequence) else [share]
    percents = [UNKNOWN if one is None else f"{100 * one:+.1f}" for one in shares]
    return f"{text}\n({' / '.join(percents)} %)" if any(word != UNKNOWN for word in percents) else text


def _setting(value: Any, lacks: bool) -> str:
    if lacks:
        return UNKNOWN
    return "not set" if value is None else toml_value(value)


def _multiplier(value: complex) -> str:
    if abs(value) < _ROUNDING:
        return f"below {_ROUNDING:.0e}"
    if abs(value.imag) < _ROUNDING:
        return f"{value.real:.4g}"
    return f"{value.real:.3g} {'+' if value.imag > 0 else '-'} {abs(value.imag):.3g}i"


def _shares(balance: EnergyBalance) -> list[tuple[str, str]]:
    """Where the work went, in shares of it; nothing if there was next to none."""
    if not balance.muscle_work_J > 0:
        return []
    parts = (
        ("held", balance.kinetic_J + balance.elastic_J + (balance.potential_J or 0.0)),
        ("slip", balance.slip_J),
        ("other constraints", balance.constraints_J),
        ("damping", balance.damping_J),
        ("integrator", balance.numerical_J),
    )
    shares = [f"{name} {100 * part / balance.muscle_work_J:.0f} %" for name, part in parts if part is not None]
    return [("of which", ", ".join(shares))]


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
