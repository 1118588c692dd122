"""Fills the tables of the pages with numbers from result files.

    python docs/site/fill_tables.py              after a result file or a table's formulas have changed
    python docs/site/fill_tables.py --check      names the pages that differ from their files; ends with 1 if any does
    python docs/site/fill_tables.py --measured slip.csv riddle2025-muscles crawler
                                                 notes which worms a result file was just measured on, in worms.toml

In a page a table stands between two comments:

    <!-- table: pipes/bends -->

    <!-- end of table -->

It is the section ``bends`` of ``docs/results/tables/pipes.toml``, with Python's ``{expression:format}`` for numbers:

    [bends]
    results = ["pipes.csv"]
    head = "| radius (m) | gait | speed (cm/s) |"
    condition = 'arena == "bend"'
    each = "| {radius_m:g} | {gait} | {100 * speed_m_per_s:.1f} |"

Every line of ``each`` is repeated for all records that meet the condition, with their columns as names. A line of
``rows`` stands once; there a record goes by the text of its first column: ``{crawler.speed_m_per_s:.3f}``. Characters
that no name may have are underscores: ``arena.friction`` is ``arena_friction``. ``bench.json:cases`` takes records from
within a JSON file; a whole one is a record that goes by the file's name. Columns ``speed_1``, ``speed_2`` .. are
together ``speed``, an array whose numbers are written side by side. True and false read yes and no, what is missing a
dash. In ``each``, ``other("text")`` is the record that goes by that text, with dashes only if there is none. A table
whose file does not exist yet stays as it is. ``docs/results/made_by.toml`` has the command that makes each file.
"""

from __future__ import annotations

import csv
import hashlib
import json
import math
import re
import sys
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import tomlkit

from annelid.config import load_config

ROOT = Path(__file__).parent.parent.parent
DOCS = ROOT / "docs"
START, END = "<!-- table:", "<!-- end of table -->"
MARKED = re.compile(rf"^{START} (?P<file>\w+)/(?P<name>\w+) -->\n(?:[^<]|<(?!!--))*{END}", re.MULTILINE)
FILE = re.compile(r"\w+\.(?:csv|json:\w+|json)")
WORMS = "results/worms.toml"
"""Result files, each with the presets that its numbers are of, and what these were then."""


class PerSegment(np.ndarray):
    """Numbers of all segments, which stand side by side in a table."""

    def __format__(self, form: str) -> str:
        return " / ".join(format(float(number), form) for number in self.ravel())


class FillError(Exception):
    """A marker, a table or a result file is not as described above."""


@dataclass(frozen=True, slots=True)
class Table:
    """A section of a file of tables.

    Attributes:
        results: The result files, those of ``docs/results``.
        head: The first line.
        rows: Lines that stand once.
        each: Lines for every record.
        condition: Which records these are for.
    """

    results: Sequence[str]
    head: str
    rows: str = ""
    each: str = ""
    condition: str = "True"


def filled(page: str, docs: Path = DOCS) -> str:
    """Returns a page with the numbers of its result files, which lie in a folder of ``docs``.

    Raises:
        FillError: A marker or its table is not of the form above, or names what its files do not have.
    """
    if not page.count(START) == page.count(END) == len(MARKED.findall(page)):
        raise FillError("a table's marker or its end is not of the form that docs/site/fill_tables.py describes")

    def block(found: re.Match[str]) -> str:
        table = table_of(found, docs)
        if missing_files(table, docs):
            return found[0]
        records = [record for file in table.results for record in records_of(file, docs)]
        marker, _, _ = found[0].partition("\n")
        return f"{marker}\n\n{lines_of(table, records)}\n\n{END}"

    return MARKED.sub(block, page)


def tables_of(page: str, docs: Path = DOCS) -> list[Table]:
    """Returns the tables of a page."""
    return [table_of(found, docs) for found in MARKED.finditer(page)]


def table_of(marker: re.Match[str], docs: Path) -> Table:
    """Reads the table that a marker names.

    Raises:
        FillError: There is no such table, or it is not of the form above.
    """
    path = docs / "results" / "tables" / f"{marker['file']}.toml"
    try:
        table = Table(**tomllib.loads(path.read_text(encoding="utf-8"))[marker["name"]])
    except (OSError, KeyError, TypeError) as error:
        raise FillError(f"{path.name}, [{marker['name']}]: {error!r}") from error
    if wrong := [file for file in table.results if not FILE.fullmatch(file)]:
        raise FillError(f"{path.name}: {wrong[0]!r} is none of NAME.csv, NAME.json and NAME.json:KEY")
    return table


def missing_files(table: Table, docs: Path) -> list[str]:
    """Returns those of a table's result files that do not exist."""
    return [file for file in table.results if not (docs / "results" / file.partition(":")[0]).exists()]


def made_by(docs: Path = DOCS) -> dict[str, str]:
    """Returns the command that makes each result file."""
    return tomllib.loads((docs / "results" / "made_by.toml").read_text(encoding="utf-8"))


def records_of(file: str, docs: Path) -> Iterator[dict[str, Any]]:
    """Reads the records of a result file: numbers and texts by the names that a template may use."""
    name, _, key = file.partition(":")
    text = (docs / "results" / name).read_text(encoding="utf-8")
    rows: Any = list(csv.DictReader(text.splitlines())) if name.endswith(".csv") else json.loads(text)
    if isinstance(rows, dict):
        rows = rows[key] if key else {Path(name).stem: rows}
    if isinstance(rows, dict):
        rows = [{"name": label, **row} for label, row in rows.items()]
    for row in rows:
        record = {identifier(column): read(value) for column, value in flat(row)}
        numbered: dict[str, list[float]] = {}
        for column, number in record.items():
            if (name_of_all := re.fullmatch(r"(.+)_\d+", column)) and isinstance(number, int | float):
                numbered.setdefault(name_of_all[1], []).extend([] if math.isnan(number) else [number])
        yield record | {name: np.array(found or [math.nan]).view(PerSegment) for name, found in numbered.items()}


def identifier(text: str) -> str:
    """Returns a text with underscores for what Python's names may not have."""
    return re.sub(r"\W|^(?=\d)", "_", text)


def flat(row: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Walks the values of nested mappings, by dotted names."""
    for name, value in row.items():
        yield from flat(value, f"{prefix}{name}.") if isinstance(value, dict) else [(prefix + name, value)]


def read(value: Any) -> Any:
    """Returns a cell as a number where it is one."""
    if isinstance(value, str):
        for kind in (int, float):
            try:
                return kind(value)
            except ValueError:
                pass
    return {"None": math.nan, "": math.nan, "True": "yes", "False": "no"}.get(str(value), value)


def lines_of(table: Table, records: Sequence[Mapping[str, Any]]) -> str:
    """Returns the lines of a table with numbers filled in.

    Raises:
        FillError: An expression has no value.
    """
    by_label = {identifier(str(next(iter(record.values())))): SimpleNamespace(**record) for record in records}

    def other(label: str) -> SimpleNamespace:
        return by_label.get(identifier(label), SimpleNamespace(**dict.fromkeys(records[0], math.nan)))

    def line(template: str, names: Mapping[str, Any]) -> str:
        return re.sub(r"[+-]?\bnan\b", "–", evaluated(f"rf'''{template}'''", names))

    chosen = [{**by_label, **record, "other": other} for record in records if evaluated(table.condition, record)]
    lines = [table.head, "|" + "---|" * (table.head.count("|") - 1)]
    lines += [line(row, by_label) for row in table.rows.splitlines()]
    lines += [line(row, names) for row in table.each.splitlines() for names in chosen]
    return "\n".join(lines)


def evaluated(expression: str, names: Mapping[str, Any]) -> Any:
    """Evaluates an expression of a table, which is this repository's own code as its commands and tutorials are."""
    try:
        return eval(expression, dict(names))
    except Exception as error:
        raise FillError(f"{expression}: {error}") from error


def main(check: bool, root: Path = ROOT) -> int:
    """Fills or checks README, the article and all pages, and names what is waited for."""
    differing, docs = False, root / "docs"
    for path in (root / "README.md", *sorted(root.glob("paper/*.md")), *sorted(docs.rglob("*.md"))):
        page, name = path.read_text(encoding="utf-8"), path.relative_to(root)
        try:
            new = filled(page, docs)
        except FillError as error:
            raise SystemExit(f"{name}: {error}") from error
        for file in {file for table in tables_of(page, docs) for file in missing_files(table, docs)}:
            print(f"{name}: waits for docs/results/{file}")
        if new != page:
            differing = True
            print(f"{name}: {'differs from its result files' if check else 'filled'}")
            if not check:
                path.write_text(new, encoding="utf-8")
    return int(check and differing)


def worm(preset: str) -> str:
    """Returns a digest of all that a preset says of its worm; another one has other numbers."""
    text = load_config(preset).model_dump_json(
        exclude={"name", "summary", "published", "duration_s"}, exclude_none=True
    )
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def measured(file: str, presets: Sequence[str], docs: Path = DOCS) -> None:
    """Notes that a result file has just been measured on presets as they are now.

    Raises:
        FillError: There is no such file.
    """
    if not presets or not (docs / "results" / file).is_file():
        raise FillError(
            f"--measured FILE PRESET..: {file!r} must be a file of {docs / 'results'}, of one preset at least"
        )
    known = tomlkit.parse((docs / WORMS).read_text(encoding="utf-8"))
    table = tomlkit.inline_table()
    table.update({preset: worm(preset) for preset in presets})
    known[file] = table
    (docs / WORMS).write_text(tomlkit.dumps(known), encoding="utf-8")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--measured"]:
        measured(sys.argv[2], sys.argv[3:])
    else:
        sys.exit(main(check="--check" in sys.argv[1:]))
