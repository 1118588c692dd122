"""The reference of a run's numbers, made from their declarations."""

from __future__ import annotations

from annelid.analysis import NUMBERS
from annelid.markdown import code, table


def page() -> str:
    """Returns the page below its introduction: a table for every section of the record."""
    lines: list[str] = []
    for section in dict.fromkeys(number.section for number in NUMBERS.values()):
        own = [number for number in NUMBERS.values() if number.section is section]
        rows = [[code(one.name), one.unit, "one a segment" if one.per_segment else "", one.meaning] for one in own]
        name = "The run" if section.__name__ == "Summary" else section.__name__
        lines += [f"## {name}", "", table(["number", "unit", "", "meaning"], rows), ""]
    return "\n".join(lines)
