"""Tables in the terminal: a run's numbers beside those to compare with, and runs side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from math import ceil
from typing import TYPE_CHECKING, NamedTuple

from annelid.analysis.comparison import LACKING, Comparison, relative_difference
from annelid.analysis.numbers import UNKNOWN, Value, three_digits
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
from annelid.errors import ConfigError, listed, shortened, suggest
from annelid.text import LINE

if TYPE_CHECKING:
    from annelid.config import RunConfig

COMPARED = ("reference", "off by")  # headings of what stands beside our numbers
MOVED = "moves by"
_SEGMENTS_SHOWN, _ONSETS_SHOWN = 6, 9
_RUNS_BESIDE_THE_FIRST = 2
_CYCLES_FOR_A_SPEED = 4.5
"""Periods of a run whose speed is read over three cycles: the first does not count, and half a period is spare."""
_STANDS_M = 1e-5
"""A shorter stride is none."""
WORDS = {
    "order": "the order in which segments contract, and how many times a wave ran from the first segment to the last",
    "onsets (s)": "the times at which segments begin to contract, in that order",
    "work goes to (%)": "what became of the muscles' net work: stored in the body, lost to slip on the ground, to "
    "contacts otherwise, to damping, or to the error of the time step. An error below 0 adds energy",
    "warnings": "what is doubtful about the run, a sentence each",
    COMPARED[0]: f"a published number; with *: that of {FORMULATION}, our run of the paper's own formulation",
    COMPARED[1]: "difference from the reference, in percent of it; of several segments the largest",
    MOVED: "with --check: how far a number moves at half the step or with one more element a side; !: not resolved",
}
"""Rows and columns that are no single number."""
_PUBLISHED_ONLY = ("elongation_first_helix_pp_m", "middle_deficit", "end_difference")
"""Numbers that the first table has only beside a published one."""
FIRST = (
    "order",
    "period_s",
    "speed_m_per_s",
    "speed_body_lengths_per_s",
    "travel_m",
    "elongation_mean_max_m",
    *_PUBLISHED_ONLY,
    "contraction_force_median_N",
    "cost_of_transport",
    "work goes to (%)",
    "warnings",
)
"""Rows of the first table of a run."""


class Row(NamedTuple):
    """One row of a run's table, as text: what it is, our number, the one to compare with, and how far ours is off."""

    label: str
    ours: str
    reference: str = ""
    deviation: str = ""


def aligned(rows: Sequence[Sequence[str]]) -> str:
    """Lays cells out in columns, a line for each row; the last cell of a row may reach beyond its column."""
    cells = [list(row[: max((i for i, cell in enumerate(row, start=1) if cell), default=0)]) for row in rows]
    widths = [max((len(row[i]) for row in cells if len(row) > i + 1), default=0) for i in range(max(map(len, cells)))]
    lines = ("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=False)) for row in cells)
    return "\n".join(line.rstrip() for line in lines)


def summary_table(
    numbers: Summary,
    config: RunConfig,
    *,
    everything: bool = False,
    moved: Callable[[str], str] | None = None,
) -> str:
    """Returns a run's numbers as a table of 80 columns, those to compare with beside them.

    Args:
        numbers: The numbers.
        config: Configuration of the run.
        everything: All rows; else those of `FIRST`.
        moved: Says how far a number, named as in `NUMBERS`, moves in finer runs; it adds a column.
    """
    headings = ["", "this run", MOVED, *(COMPARED if references(config, numbers.controller) else ())]
    lines = [headings]
    for name, (label, ours, *beside) in _rows(numbers, config, everything=everything).items():
        further = "" if moved is None or getattr(numbers, name, None) is None else moved(name)
        lines.append([label, ours, further, *beside])
    return aligned(lines if moved is not None else [[*line[:2], *line[3:]] for line in lines])


def summary_rows(numbers: Summary, config: RunConfig, *, everything: bool = False) -> list[Row]:
    """Returns the rows of a run's table in which there is a number, ours or one to compare with.

    Args:
        numbers: The numbers.
        config: Configuration of the run.
        everything: All rows; else those of `FIRST`.
    """
    return list(_rows(numbers, config, everything=everything).values())


def explained(row: str) -> list[tuple[str, str, str]]:
    """Returns what a row or a column of the tables means: what tables call it, name of the number, meaning.

    Args:
        row: What a table calls it, with or without its unit, or the name of the number.

    Raises:
        ConfigError: No table has such a row.
    """
    known = [(heading, "", meaning) for heading, meaning in WORDS.items()]
    known += [(one.heading, one.name, one.meaning) for one in NUMBERS.values() if one.label]
    wanted = row.casefold().strip()
    found = [
        one for one in known if wanted in (one[0].casefold(), one[0].partition(" (")[0].casefold(), one[1].casefold())
    ]
    if not found:
        raise ConfigError(f"no row is called {row!r}: {suggest(row, [heading for heading, *_ in known])}")
    return found


def _rows(numbers: Summary, config: RunConfig, *, everything: bool) -> dict[str, Row]:
    """Rows by the name of their number; those without any number are left out."""
    beside = references(config, numbers.controller)
    ended_early = "" if numbers.status == "complete" else numbers.status.replace("_", " ")
    doubts = ended_early, f"{len(numbers.warnings)}, below" if numbers.warnings else ""
    cells = {
        "order": ("order", _order(numbers)),
        "onsets (s)": ("onsets (s)", _onsets(numbers)),
        **{name: (one.heading, one.text(getattr(numbers, name))) for name, one in NUMBERS.items() if one.label},
        "work goes to (%)": ("work goes to (%)", _shares_of_the_work(numbers)),
        "warnings": ("warnings", ", ".join(filter(None, doubts)) or "none"),
    }
    if numbers.speed_m_per_s is None and numbers.travel_m is not None:
        cells["speed_m_per_s"] = (NUMBERS["speed_m_per_s"].heading, _why_no_speed(numbers))
    names = cells if everything else [one for one in FIRST if one not in _PUBLISHED_ONLY or one in beside]
    rows = {
        name: Row(*cells[name], _theirs(name, beside.get(name)), _deviation(name, numbers, beside.get(name)))
        for name in names
    }
    return {name: row for name, row in rows.items() if row.ours != UNKNOWN or row.reference}


def _order(numbers: Summary) -> str:
    if not numbers.order:
        return "no contraction"
    silent = numbers.rhythm_verdict == "silent"
    if numbers.wave:
        times = f"{numbers.full_cycles} time{'' if numbers.full_cycles == 1 else 's'}"
        return f"{_dashed(range(1, numbers.n_segments + 1))}, {times}{', then none' if silent else ''}"
    last = "then none" if silent else "too short to judge" if numbers.wave is None else "no wave"
    return f"{_dashed(numbers.order)}, {last}"


def _dashed(segments: Sequence[int]) -> str:
    if len(segments) <= _SEGMENTS_SHOWN:
        return "-".join(map(str, segments))
    rising = all(b == a + 1 for a, b in pairwise(segments))
    return f"{segments[0]}-{segments[1]}-..-{segments[-1]}" if rising else f"{_dashed(segments[:_SEGMENTS_SHOWN])}-.."


def _onsets(numbers: Summary) -> str:
    shown = " ".join(f"{time:.2f}" for time in numbers.onsets_s[:_ONSETS_SHOWN])
    more = f" .. {numbers.onsets_s[-1]:.2f}" if len(numbers.onsets_s) > _ONSETS_SHOWN else ""
    return shown + more or UNKNOWN


def duration_for_a_speed(numbers: Summary) -> int | None:
    """Returns how long a run should be for a speed that it does not have yet, s; None where that is not known.

    A run without a period is taken to go on from segment to segment as it has begun.
    """
    onsets_s = numbers.onsets_s
    if numbers.speed_m_per_s is not None or numbers.travel_m is None or len(onsets_s) < 2:
        return None
    # A run that was interrupted goes on to its own end first.
    if numbers.rhythm_verdict == "silent" or numbers.status != "complete":
        return None
    period_s = numbers.period_s or numbers.n_segments * (onsets_s[-1] - onsets_s[0]) / (len(onsets_s) - 1)
    duration_s = ceil(onsets_s[0] + _CYCLES_FOR_A_SPEED * period_s)
    return duration_s if duration_s > onsets_s[0] + (numbers.duration_s or 0.0) else None


def _why_no_speed(numbers: Summary) -> str:
    duration_s = duration_for_a_speed(numbers)
    if numbers.rhythm_verdict == "silent":
        return "none: the rhythm stops"
    return "needs two cycles" + (f", better four: --duration {duration_s}" if duration_s else "")


def _shares_of_the_work(numbers: Summary) -> str:
    """Says where the muscles' work went, in percent."""
    work, kinetic, elastic = numbers.energy_muscle_work_J, numbers.energy_kinetic_J, numbers.energy_elastic_J
    if work is None or kinetic is None or elastic is None or work <= 0:
        return UNKNOWN
    parts = {
        "stored": kinetic + elastic + (numbers.energy_potential_J or 0.0),
        "slip": numbers.energy_slip_J,
        "contact": numbers.energy_constraints_J,
        "damping": numbers.energy_damping_J,
        "step error": numbers.energy_numerical_J,
    }
    return ", ".join(f"{name} {100 * part / work:z.0f}" for name, part in parts.items() if part is not None)


def comparison_table(comparison: Comparison, *, everything: bool = False) -> str:
    """Returns the numbers of runs side by side, one in a cell, with the differences to the first run.

    Args:
        comparison: The runs.
        everything: All numbers, and a row for each segment; else those of `FIRST`, and the mean of the segments.
    """
    keys = "\n".join(f"{i}: {label}" for i, label in enumerate(comparison.labels, start=1))
    rows = dict(_compared(comparison, everything=everything))
    words = {
        "ended": [status.replace("_", " ") for status in comparison.statuses],
        "order": [_dashed(order) or UNKNOWN for order in comparison.orders],
    }
    blocks = [keys]
    for shown in _blocks(len(comparison.labels)):
        lines = [["", *(str(i + 1) for i in shown), *(f"{i + 1} to 1" for i in shown[1:])]]
        lines += [[heading, *(texts[i] for i in shown)] for heading, texts in words.items()]
        for heading, (texts, values) in rows.items():
            apart = (relative_difference(values[0], values[i]) for i in shown[1:])
            differences = (f"{_signed(100 * one)} %" if isinstance(one, float) else "" for one in apart)
            lines.append([heading, *(texts[i] for i in shown), *differences])
        blocks.append(aligned(lines))
    return "\n\n".join(blocks)


def _compared(
    comparison: Comparison, *, everything: bool
) -> Iterator[tuple[str, tuple[list[str], list[float | None]]]]:
    """Yields headings of rows, each with the numbers of all runs as text and as they are."""
    first = [name for name in FIRST if name in comparison.numbers and name not in _PUBLISHED_ONLY]
    for name in dict.fromkeys([*first, *(comparison.numbers if everything else ())]):
        number, each = NUMBERS[name], [_listed(value) for value in comparison.numbers[name]]
        columns: Mapping[str, list[float | None]] = {"": [one[0] if len(one) == 1 else _mean(one) for one in each]}
        if number.per_segment and everything:
            longest = max(map(len, each))
            columns = {f" {i + 1}": [one[i] if i < len(one) else None for one in each] for i in range(longest)}
        for segment, values in columns.items():
            if number.label and any(value is not None for value in values):
                mean = ", mean" if number.per_segment and not segment else ""
                heading = number.heading.replace(number.label, f"{number.label}{segment}{mean}", 1)
                yield heading, ([number.text(value) for value in values], values)


def _listed(value: Value) -> list[float | None]:
    return list(value) if isinstance(value, Sequence) else [value]


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known else None


def _blocks(n_runs: int) -> list[list[int]]:
    """The first run with some others at a time, as many as fit beside it."""
    others = range(1, n_runs)
    return [[0, *others[i : i + _RUNS_BESIDE_THE_FIRST]] for i in range(0, n_runs - 1, _RUNS_BESIDE_THE_FIRST)]


def fields_table(comparison: Comparison) -> str:
    """Returns the fields in which configurations and networks differ; of different kinds only those that all have."""
    kinds = tuple(field.removesuffix("kind") for field in comparison.fields if field.endswith(".kind"))
    parted = (*kinds, "arena.") if "body." in kinds else kinds
    left_out = [field for field, one in comparison.fields.items() if field.startswith(parted) and LACKING in one]
    network = comparison.network
    if network is not None:
        left_out.append("controller.text")
    fields = {
        field: ["not set" if one is None else UNKNOWN if one is LACKING else toml_value(one) for one in values]
        for field, values in {**comparison.fields, **(network or {})}.items()
        if field not in left_out
    }
    widest = max(map(len, fields), default=0)
    blocks = []
    for shown in _blocks(len(comparison.labels)) if fields else []:
        most = max((LINE - widest) // len(shown) - 4, 6)
        lines = [[field, *(shortened(values[i], most) for i in shown)] for field, values in fields.items()]
        blocks.append(aligned([["", *(str(i + 1) for i in shown)], *lines]))
    if network == {}:
        blocks.append("the networks are the same")
    if any(field != "controller.text" for field in left_out):
        named = listed(sorted({field.partition(".")[0] for field in left_out}))
        blocks.append(f"different kinds of {named}: only fields that all have; --json lists all")
    return "\n\n".join(blocks)


def _deviation(name: str, numbers: Summary, entry: Published | None) -> str:
    """By how many percent our number, or that of the segment where it is most, is off the one to compare with.

    Empty for shares, speeds of computing and words, for the range over sensors, and where either number is lacking.
    """
    if entry is None or name in SPREAD or isinstance(entry.value, str) or NUMBERS[name].shown_unit in ("%", ""):
        return ""
    shares = [one for one in _listed(relative_difference(entry.value, getattr(numbers, name))) if one is not None]
    return f"{_signed(100 * max(shares, key=abs))} %" if shares else ""


def legend(numbers: Summary, config: RunConfig) -> str:
    """Says where the numbers to compare with come from; empty where there are none."""
    beside = references(config, numbers.controller)
    if not beside:
        return ""
    places = dict.fromkeys(entry.place for entry in beside.values() if entry.paper != FORMULATION)
    sections = sorted(place.removeprefix("section ") for place in places if place.startswith("section "))
    others = [place for place in places if not place.startswith("section ")]
    where = ", ".join([*others, *([f"section{'s' * (len(sections) > 1)} {listed(sections)}"] if sections else [])])
    paper = next(entry.paper for entry in beside.values() if entry.paper != FORMULATION)
    ours = f"; *: run of {FORMULATION}" if stands_for_the_papers(config, numbers.controller) else ""
    return f"reference: {paper}, {where}{ours}"


def closing_sentence(numbers: Summary, config: RunConfig) -> str:
    """Says in a sentence what a run shows: how it stands to its references, or how its segments contract."""
    if numbers.status != "complete":
        return f"{numbers.status.replace('_', ' ')} after {three_digits(numbers.duration_s or 0.0)} s"
    if not references(config, numbers.controller):
        return _about_the_rhythm(numbers)
    preset, changed = changed_fields(config)
    of_papers = stands_for_the_papers(config, numbers.controller)
    said = [f"differs from {preset} in {listed(changed)}; references are of the unchanged worm"] if changed else []
    if of_papers and config.body.has_rigid_crossings:
        said.append(_about_rigid_crossings(numbers))
    if said:
        return "\n".join(said)
    if not of_papers:
        return _about_the_rhythm(numbers)
    apart, within = _apart_from_the_papers(numbers), f"within {100 * ELONGATION_WITHIN:g} %"
    if apart:
        return f"{config.name} does not reproduce the paper's formulation {within}: {', '.join(apart)}"
    return f"reproduces order, period and elongation of the paper's formulation {within}"


def _about_the_rhythm(numbers: Summary) -> str:
    reason, verdict, stride_m = numbers.rhythm_reason, numbers.rhythm_verdict, numbers.stride_m
    if reason is None or verdict == "silent":
        return ""  # A warning says that.
    said = f"the segments contract out of order: {reason}"
    if numbers.wave:
        said = "the segments contract one after the other from front to rear"
    elif verdict != "disordered":
        said = f"the segments contract in {reason}" if verdict else "the run is too short to judge the order"
    if stride_m is None:
        return said
    if abs(stride_m) < _STANDS_M:
        return f"{said}; the worm stays in its place"
    way = "forwards" if stride_m > 0 else "backwards"
    return f"{said}; the worm moves {way} by {NUMBERS['stride_m'].text(abs(stride_m))} cm a cycle"


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
            f"{name} {f'{_signed(100 * share)} %' if isinstance(share, float) else 'unknown'}"
            for name, share, within in compared
            if not isinstance(share, float) or abs(share) > within
        ),
    ]


def _theirs(name: str, entry: Published | None) -> str:
    if entry is None or isinstance(entry.value, str):
        return "" if entry is None else str(entry.value)
    return NUMBERS[name].text(entry.value) + ("*" if entry.paper == FORMULATION else "")


def _about_rigid_crossings(numbers: Summary) -> str:
    shares = _listed(relative_difference(formulation().elongation_mean_max_m, numbers.elongation_mean_max_m))
    mean = _mean(shares) if numbers.period_s else None
    times = "farther than" if mean is None else f"{1.0 + mean:.1f} times as far as"
    return f"crossings of strands are rigid: segments elongate {times} those of {FORMULATION}"


def _signed(percent: float) -> str:
    return f"{percent:+z.1f}" if abs(percent) < 9.95 else f"{percent:+.0f}"
