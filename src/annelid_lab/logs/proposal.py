"""A map proposed for a log: the names, units and rates that are recognised, for its user to check and complete."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from annelid.textfiles import toml_value
from annelid_lab.logs.maps import UNIT_AT_END, UNITS, plain_unit
from annelid_lab.logs.measured import clock_times, point_in, points_of
from annelid_lab.logs.tables import LogTable, read_table

_SPELT_OUT = {
    "seconds": "s",
    "milliseconds": "ms",
    "millis": "ms",
    "micros": "us",
    "meters": "m",
    "centimeters": "cm",
    "millimeters": "mm",
}
_TIME = re.compile(
    r"t|(?:elapsed|log|run|sim)?[_ ]?times?|zeit|timestamps?|clock|elapsed|date|date.?time|seconds|millis|micros",
    re.IGNORECASE,
)
_SEGMENT = re.compile(
    r"(?:.*[_ .])?(?:s|seg|segment|spring|stretch|sensor|len|length|l|(pot|adc|analog|a|raw|counts?))[_ ]?(\d+)"
    r"(?:[_ ]?(?:length|len|stretch))?(?:[_ ]?(left|right|l|r|mean|avg))?",
    re.IGNORECASE,
)
"""A segment's sensor: whether it gives counts, the number, and the side."""
_TRAVEL = re.compile(r"travel|distance|displacement|forward|position|x", re.IGNORECASE)
_SIDES = {"l": "left", "left": "left", "r": "right", "right": "right"}
_RATE = re.compile(r"(?:frame rate|frequency|fps)\W+(\d+(?:\.\d+)?)|^Trajectories\s+(\d+(?:\.\d+)?)", re.IGNORECASE)
_LENGTH_UNIT = re.compile(r"length units\W+(meters|centimeters|millimeters)", re.IGNORECASE)


def proposed_map(path: Path) -> tuple[str, list[str]]:
    """Proposes a map for a log by the names of its columns.

    Nothing that the log does not say is filled in: such a line is a comment with the words to complete.

    Args:
        path: The log, in any format of `read_measured`.

    Returns:
        The map as TOML, and what its user has yet to state, a phrase each.

    Raises:
        UnreadableText: The log cannot be read, or no name is recognised as a signal.
        MissingDependency: Its format needs a package that is not installed.
    """
    table = read_table(path, _names_in)
    points = _points_in(table)
    missing = list[str]()
    lines = [f"# What the columns of {toml_value(path.name)} are, as far as their names say. Check every line."]
    time = next((name for name in table.names if _TIME.fullmatch(_split_unit(name, table)[0].rpartition(".")[2])), None)
    if time is not None:
        lines += [f"time = {toml_value(time)}"]
        base, unit, is_stated = _split_unit(time, table)
        unit = unit or _SPELT_OUT.get(base.lower())
        if unit and not is_stated:
            lines += [f'time_unit = "{unit}"']
        elif not unit and clock_times(time, table) is None:
            lines += ['# time_unit = "s"   # s, ms, us or min: the log does not say']
            missing += ["time_unit, the unit of the time"]
    elif rate := _RATE.search(table.above):
        lines += [f"rate_Hz = {rate[1] or rate[2]}   # as the head of the file says"]
    else:
        lines += ["# rate_Hz = 25   # rows a second: the log does not say"]
        missing += ["rate_Hz, the rows a second"]
    if points:
        length = _LENGTH_UNIT.search(table.above)
        more, entries, unstated = _points_entries(points, _SPELT_OUT[length[1].lower()] if length else None)
        lines += more
    else:
        entries, unstated = _signals_entries([name for name in table.names if name != time], table)
    missing += unstated
    if all(entry.startswith("#") for entry in entries):
        missing += ["what the columns are, under [map]; docs/how_to/measured_data.md lists the signals"]
    return "\n".join([*lines, "", "[map]", *entries, ""]), missing


def _points_entries(
    points: Mapping[str, tuple[Sequence[str], str | None]], unit: str | None
) -> tuple[list[str], list[str], list[str]]:
    """Lines above the entries of tracked points, the entries, and what is yet to be stated."""
    (first, (individuals, own)), *others = points.items()
    lines, missing = [], []
    if len(individuals) > 1:
        lines += [f"# individual = {toml_value(individuals[0])}   # one of {', '.join(map(toml_value, individuals))}"]
        missing += ["individual, the animal to compare"]
    if not (own or unit):
        lines += ["# m_per_px = 0.001   # metres in a pixel: the log does not say"]
        missing += ["m_per_px, the metres in a pixel"]
    stated = "" if own or not unit else f', unit = "{unit}"'
    entries = [f'{toml_value(first)} = {{ signal = "travel"{stated} }}']
    if others:
        last = toml_value(others[-1][0])
        entries += [
            "# The distance of two points, in place of the travel of one:",
            f'# {toml_value(first)} = {{ signal = "ring_distance[1]", distance_to = {last}{stated} }}',
        ]
    return lines, entries, missing


def _signals_entries(names: Sequence[str], table: LogTable) -> tuple[list[str], list[str]]:
    """Entries of the columns that are no points, and whose unit is yet to be stated."""
    found = {name: _SEGMENT.fullmatch(_split_unit(name, table)[0]) for name in names}
    from_0 = any(match and int(match[2]) == 0 for match in found.values())
    entries, missing = (["# Segments are numbered from 0 in the log, from 1 in annelid."] if from_0 else []), []
    for name in names:
        base, unit, is_stated = _split_unit(name, table)
        if match := found[name]:
            signal = f"stretch_length[{int(match[2]) + from_0}, {_SIDES.get((match[3] or '').lower(), 'mean')}]"
        elif _TRAVEL.fullmatch(base):
            signal = "travel"
        else:
            example = '{ signal = "stretch_length[1, mean]", unit = "mm" }'
            entries += [f"# {toml_value(name)} = {example}   # an example"]
            continue
        counted = "pixel" if unit == "px" else "count" if unit is None and match and match[1] else None
        if counted:
            own = "" if unit else ', unit = "1", offset = "free"'
            entries += [f"# scale: the metres in a {counted}, such as 0.0001; the log does not say"]
            entries += [f'{toml_value(name)} = {{ signal = "{signal}"{own}, scale = "?" }}']
            missing += [f"scale, the metres in a {counted}, of {toml_value(name)}"]
        elif unit is None:
            entries += [f'{toml_value(name)} = {{ signal = "{signal}", unit = "?" }}   # such as "mm"']
            missing += [f"the unit of {toml_value(name)}"]
        elif is_stated:
            entries += [f'{toml_value(name)} = "{signal}"']
        else:
            entries += [f'{toml_value(name)} = {{ signal = "{signal}", unit = "{unit}" }}']
    return entries, missing


def _names_in(names: Sequence[str]) -> int:
    """How good a header is: texts that differ, and coordinates that have the names of their points."""
    if len(set(names)) < len(names):
        return 0
    return sum(bool(re.search(r"[^\W\d]", name)) + bool(point_in(name)) for name in names)


def _points_in(table: LogTable) -> dict[str, tuple[list[str], str | None]]:
    """Tracked points: the individuals that have each, and its unit where a column or a row of units says so."""
    found: dict[str, tuple[list[str], str | None]] = {}
    for point in dict.fromkeys(filter(None, map(point_in, table.names))):
        if axes := points_of(point, table.names):
            _, unit, is_stated = _split_unit(next(iter(axes.values()))["x"], table)
            found[point] = sorted(axes), unit if is_stated else None
    return found


def _split_unit(name: str, table: LogTable) -> tuple[str, str | None, bool]:
    """A column's name without its unit, the unit, and whether a map need not repeat it."""
    if name in table.units:
        return name, table.units[name], True
    if match := UNIT_AT_END.search(name):
        base, unit = name[: match.start()], plain_unit(match[1])
        if unit in UNITS:
            return base, unit, True
        if unit.lower() in _SPELT_OUT:
            return base, _SPELT_OUT[unit.lower()], False
    return name, None, False
