"""The reference of a run's numbers, made from their declarations."""

from __future__ import annotations

from annelid.analysis import NUMBERS
from annelid.draw.summary_table import WORDS
from annelid.markdown import code, table


def page() -> str:
    """Returns the page below its introduction: rows that are no single number, and a table for each section."""
    lines = [table(["row or column of a table", "meaning"], list(WORDS.items())), ""]
    for section in dict.fromkeys(number.section for number in NUMBERS.values()):
        own = [number for number in NUMBERS.values() if number.section is section]
        rows = [
            [
                code(one.name),
                one.unit,
                one.label and one.heading,
                "one a segment" if one.per_segment else "",
                one.meaning,
            ]
            for one in own
        ]
        name = "The run" if section.__name__ == "Summary" else section.__name__
        lines += [f"## {name}", "", table(["number", "unit", "in tables", "", "meaning"], rows), ""]
    return "\n".join(lines)
