"""The reference of a run's numbers, made from their declarations."""

from __future__ import annotations

from annelid.analysis import NUMBERS
from annelid.draw.summary_table import WORDS
from annelid.markdown import code, table

INTRODUCTION = """# The numbers of a run

This page lists all numbers of `annelid.summary(run)`. A number has the same name in Python, in `annelid show --json`,
in a sweep and in tables as CSV. `annelid list numbers` prints the same list. A number that cannot be computed is None
(null), in a sweep NaN. [Gait](../evidence/gait.md) defines the locomotion metrics and the energy balance. Tables show
three significant digits. `annelid show --explain ROW` explains a row. These rows and columns are no single number:
"""


def page() -> str:
    """Returns the page: a table for every section of the record."""
    lines = [INTRODUCTION, table(["row or column of a table", "meaning"], list(WORDS.items())), ""]
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
