"""Tables in the terminal: a run's numbers beside those to compare with, and runs side by side."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from rich import box
from rich.table import Table

from annelid.analysis.comparison import LACKING, Comparison, relative_difference
from annelid.analysis.numbers import UNKNOWN, Value
from annelid.analysis.paper import (
    ELONGATION_WITHIN,
    FORMULATION,
    PERIOD_WITHIN,
    SPREAD,
    Published,
    changed_fields,
    formulation,
    references,
    stands_for_the_papers,
)
from annelid.analysis.summary import NUMBERS, Summary
from annelid.config import toml_value
from annelid.errors import listed, shortened

if TYPE_CHECKING:
    from annelid.config import RunConfig

MOST_CHARACTERS = 400
"""Of a value in a table of fields; a scene has up to a million."""
_ONSETS_SHOWN = 12
COMPARED = ("reference", "deviation")  # headings of what stands beside our numbers
NEXT = (
    f"annelid run {FORMULATION} (that formulation itself, a minute), "
    "riddle2023-rods (rigid crossings), wang (the robot)"
)
"""What to run after the first worm."""
_IN_BRACKETS = {
    "period_s": ("period_std_s", "std {}"),
    "speed_m_per_s": ("speed_body_lengths_per_s", "{}"),
    "stride_m": ("stride_body_lengths", "{}"),
}
"""Numbers behind which another is printed in brackets."""
_NO_ROW = {"duration_s", "energy_slip_J", *(name for name, _ in _IN_BRACKETS.values())}
"""Numbers without a row of their own in the table of a run, which has them elsewhere."""


class Row(NamedTuple):
    """One row of a run's table, as text: what it is, our number, the one to compare with, and how far ours is off."""

    label: str
    ours: str
    reference: str = ""
    deviation: str = ""


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


def summary_table(numbers: Summary, config: RunConfig, moved: Callable[[str], str] | None = None) -> Table:
    """Returns a run's numbers as a table for the terminal, those to compare with beside them.

    Args:
        numbers: The numbers.
        config: Configuration of the run.
        moved: Says how far a number, named as in `NUMBERS`, moves in finer runs; it adds a column.
    """
    compared = COMPARED if references(config) else ()
    duration = "" if numbers.duration_s is None else f", {numbers.duration_s:g} s"
    title = f"{numbers.name}: {numbers.n_segments} segments{duration}, {numbers.status.replace('_', ' ')}"
    caption = legend(numbers, config) if compared else None
    checked = () if moved is None else ("moves by",)
    table = framed_table("quantity", "this run", *checked, *compared, title=title, caption=caption)
    for column, narrowest in zip(table.columns, (12, 16), strict=False):
        column.min_width = narrowest
    for name, (label, ours, *beside) in _rows(numbers, config).items():
        table.add_row(label, ours, *(() if moved is None else (moved(name),)), *beside[: len(compared)])
    return table


def summary_rows(numbers: Summary, config: RunConfig, only: Collection[str] | None = None) -> list[Row]:
    """Returns the rows of a run's table in which there is a number, ours or one to compare with.

    Args:
        numbers: The numbers.
        config: Configuration of the run.
        only: Names of the numbers wanted, as in `NUMBERS`; all for None.
    """
    return [row for name, row in _rows(numbers, config).items() if only is None or name in only]


def _rows(numbers: Summary, config: RunConfig) -> dict[str, Row]:
    """Rows by the name of their number; those without any number are left out."""
    beside = references(config)
    # A planar worm has one sensor per segment, and no name for it.
    sensor = config.body.first_sensor
    cells = {"order": ("segment at onset (s)", _onsets(numbers)), "wave": ("wave 1-2-..-N", _wave(numbers))}
    # What is no section's own, such as the speed of computing, comes last.
    for name, number in sorted(NUMBERS.items(), key=lambda one: one[1].section is Summary):
        if name == "cycles" and not numbers.cycles:
            continue
        if number.label and name not in _NO_ROW and (sensor or ", mean" not in number.label):
            label = number.label.replace("first helix", sensor) if sensor else number.label.replace(", first helix", "")
            cells[name] = (label, _ours(name, numbers))
        if name == "energy_muscle_work_J":
            cells["energy"] = ("of which", _shares_of_the_work(numbers))
    rows = {
        name: Row(*cell, _theirs(name, beside.get(name)), _deviation(name, numbers, beside.get(name)))
        for name, cell in cells.items()
    }
    return {name: row for name, row in rows.items() if row.ours != UNKNOWN or row.reference}


def _ours(name: str, numbers: Summary) -> str:
    text = NUMBERS[name].text(getattr(numbers, name))
    further, form = _IN_BRACKETS.get(name, ("", ""))
    if further and (value := getattr(numbers, further)) is not None:
        text += f" ({form.format(NUMBERS[further].text(value))})"
    return text


def _onsets(numbers: Summary) -> str:
    pairs = list(zip(numbers.order, numbers.onsets_s, strict=True))
    onsets = ", ".join(f"{segment} at {time:.2f}" for segment, time in pairs[:_ONSETS_SHOWN])
    return onsets + _and_more(pairs) or "none"


def _and_more(items: Sequence[Any]) -> str:
    return f", and {len(items) - _ONSETS_SHOWN} more" if len(items) > _ONSETS_SHOWN else ""


def _wave(numbers: Summary) -> str:
    times = f"{numbers.full_cycles} time{'' if numbers.full_cycles == 1 else 's'}"
    return f"yes, {times}" if numbers.wave else "too short to judge" if numbers.wave is None else f"no ({times})"


def _shares_of_the_work(numbers: Summary) -> str:
    """Says where the muscles' work went, in percent."""
    work, kinetic, elastic = numbers.energy_muscle_work_J, numbers.energy_kinetic_J, numbers.energy_elastic_J
    if work is None or kinetic is None or elastic is None or work <= 0:
        return UNKNOWN
    parts = {
        "stored": kinetic + elastic + (numbers.energy_potential_J or 0.0),
        "slip": numbers.energy_slip_J,
        "other constraints": numbers.energy_constraints_J,
        "damping": numbers.energy_damping_J,
        "integrator": numbers.energy_numerical_J,
    }
    return ", ".join(f"{name} {100 * part / work:z.0f} %" for name, part in parts.items() if part is not None)


def comparison_table(comparison: Comparison) -> Table:
    """Returns the numbers of runs side by side; below each but the first run's, the difference to it."""
    caption = f"in brackets: difference to {comparison.labels[0]}; pp: peak to peak"
    table = _side_by_side("quantity", comparison.labels, caption)
    table.add_row("status", *(status.replace("_", " ") for status in comparison.statuses))
    orders = ("-".join(map(str, order[:_ONSETS_SHOWN])) + _and_more(order) for order in comparison.orders)
    table.add_row("order of contractions", *(order or UNKNOWN for order in orders))
    for name, values in comparison.numbers.items():
        if NUMBERS[name].label and any(value is not None for value in values):
            shares = (_percents(share, lambda percent: f"{percent:+.1f}") for share in comparison.differences(name))
            below = (f"\n({share})" if share else "" for share in shares)
            texts = map(NUMBERS[name].text, values)
            table.add_row(NUMBERS[name].label, *(text + more for text, more in zip(texts, below, strict=True)))
    return table


def fields_table(comparison: Comparison) -> Table:
    """Returns the fields in which the configurations differ; of worms of different kinds only those that all have."""
    other_kinds = "body.kind" in comparison.fields
    caption = "worms of different kinds: of body and arena only fields that all have; --json lists all"
    table = _side_by_side("field of the configuration", comparison.labels, caption if other_kinds else None)
    for field, values in comparison.fields.items():
        if not (other_kinds and field.startswith(("body.", "arena.")) and LACKING in values):
            texts = ("not set" if one is None else UNKNOWN if one is LACKING else toml_value(one) for one in values)
            table.add_row(field, *(shortened(text, MOST_CHARACTERS) for text in texts))
    return table


def _deviation(name: str, numbers: Summary, entry: Published | None) -> str:
    """By how many percent our number, or that of each segment, is above the one to compare with.

    Empty for shares, speeds of computing and words, for the range over sensors, and where either number is lacking.
    """
    if entry is None or name in SPREAD or isinstance(entry.value, str) or NUMBERS[name].shown_unit in ("%", ""):
        return ""
    return _percents(relative_difference(entry.value, getattr(numbers, name)), _signed)


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
    apart, within = _apart_from_the_papers(numbers), f"within {100 * ELONGATION_WITHIN:g} %"
    if apart:
        return f"{config.name} does not reproduce the paper's formulation {within}: {', '.join(apart)}; next: {NEXT}"
    return (
        f"{config.name} reproduces order, period and mean elongation of the paper's formulation {within}; next: {NEXT}"
    )


def _apart_from_the_papers(numbers: Summary) -> list[str]:
    """Says in what a run of three segments differs from the paper's own formulation by more than it may."""
    theirs = formulation()
    orders = ["-".join(map(str, one.order)) or "none" for one in (numbers, theirs)]
    shares = relative_difference(theirs.elongation_mean_max_m, numbers.elongation_mean_max_m)
    of_each = shares if isinstance(shares, Sequence) else [None] * theirs.n_segments
    compared = [("period", relative_difference(theirs.period_s, numbers.period_s), PERIOD_WITHIN)]
    compared += [(f"mean elongation of segment {i}", one, ELONGATION_WITHIN) for i, one in enumerate(of_each, start=1)]
    return [
        *([f"order {orders[0]} in place of {orders[1]}"] if numbers.order != theirs.order else []),
        *(
            f"{name} {_percents(share, _signed) or 'unknown'}"
            for name, share, within in compared
            if not isinstance(share, float) or abs(share) > within
        ),
    ]


def _side_by_side(first: str, labels: Sequence[str], caption: str | None) -> Table:
    table = framed_table(first, *labels, caption=caption)
    for column in table.columns[1:]:
        column.min_width = 10
    return table


def _theirs(name: str, entry: Published | None) -> str:
    if entry is None:
        return ""
    source = "" if entry.paper == FORMULATION else " [P]"
    if isinstance(entry.value, str):
        return f"{entry.value}{source}"
    return f"{NUMBERS[name].text(entry.value)}{source}"


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


def _percents(shares: Value, form: Callable[[float], str]) -> str:
    """Writes a share, or one per segment, in percent; nothing where none is known."""
    each = shares if isinstance(shares, Sequence) else [shares]
    if all(share is None for share in each):
        return ""
    return f"{' / '.join(UNKNOWN if share is None else form(100 * share) for share in each)} %"


def _signed(percent: float) -> str:
    return f"{percent:+z.1f}" if abs(percent) < 9.95 else f"{percent:+.0f}"
