"""The reference of a run's numbers, made from their declarations."""

from __future__ import annotations

from annelid.analysis import NUMBERS
from annelid.markdown import code, table

INTRODUCTION = """# The numbers of a run

This page lists all numbers of `annelid.summary(run)`. A number has the same name in Python, in `annelid show --json`,
in a sweep and in tables as CSV. `annelid list numbers` prints the same list. A number that cannot be computed is None
(null), in a sweep NaN. [Gait](../evidence/gait.md) defines the locomotion metrics and the energy balance.
"""


def page() -> str:
    """Returns the page: a table for every section of the record."""
    lines = [INTRODUCTION]
    for section in dict.fromkeys(number.section for number in NUMBERS.values()):
        own = [number for number in NUMBERS.values() if number.section is section]
        rows = [[code(one.name), one.unit, "one a segment" if one.per_segment else "", one.meaning] for one in own]
        name = "The run" if section.__name__ == "Summary" else section.__name__
        lines += [f"## {name}", "", table(["number", "unit", "", "meaning"], rows), ""]
    return "\n".join(lines)
