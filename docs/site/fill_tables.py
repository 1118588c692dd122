"""Fills the tables of the pages with numbers from result files.

    python docs/site/fill_tables.py              after a result file or a marker has changed
    python docs/site/fill_tables.py --check      names the pages that differ from their files; ends with 1 if any does
    python docs/site/fill_tables.py --measured slip.csv riddle2025-muscles crawler
                                                 notes which worms a result file was just measured on, in worms.toml

A table stands between two comments. The first names the result files, the command that makes them, and the table, with
Python's ``{expression:format}`` for numbers; published numbers are written out:

    <!-- table: results/speed.csv
    made by: annelid study speed -o speed
    | gait | friction | speed (cm/s) |
    |---|---|---|
    for each if quantity == "friction":
    | `{gait}` | {value} | {100 * speed_m_per_s:.1f} |
    -->

    <!-- end of table -->

A record goes by the text of its first column: ``{crawler.speed_m_per_s:.3f}``. The line below ``for each`` is repeated
for every record, with its columns as names. Characters that no name may have are underscores:
``arena.friction`` is ``arena_friction``. ``results/bench.json:cases`` takes records from within a JSON file; a whole
one is a record that goes by the file's name. Columns ``speed_1``, ``speed_2`` .. are together ``speed``, an array whose
numbers are written side by side. True and false read yes and no, what is missing a dash. Within ``for each``,
``other("text")`` is the record that goes by that text, with dashes only if there is none. A table whose file does not
exist yet stays as it is.
"""

from __future__ import annotations

import csv
import hashlib
import json
import math
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import tomlkit

from annelid.config import load_config

ROOT = Path(__file__).parent.parent.parent
DOCS = ROOT / "docs"
START, END = "<!-- table:", "<!-- end of table -->"
MARKED = re.compile(
    rf"^(?P<marker>{START} (?P<files>.+)\nmade by: (?P<command>.+)\n(?P<template>(?:.+\n)+)-->\n)"
    rf"(?:[^<]|<(?!!--))*{END}",
    re.MULTILINE,
)
FILE = re.compile(r"results/\w+\.(?:csv|json:\w+|json)")
WORMS = "results/worms.toml"
"""Result files, each with the presets that its numbers are of, and what these were then."""
EACH = re.compile(r"for each(?: if (?P<condition>.+))?:")


class PerSegment(np.ndarray):
    """Numbers of all segments, which stand side by side in a table."""

    def __format__(self, form: str) -> str:
        return " / ".join(format(float(number), form) for number in self.ravel())


class FillError(Exception):
    """A marker or a result file is not as described above."""


def filled(page: str, docs: Path = DOCS) -> str:
    """Returns a page with the numbers of its result files, which lie in a folder of ``docs``.

    Raises:
        FillError: A marker is not of the form above, or names what its files do not have.
    """
    blocks = list(MARKED.finditer(page))
    if page.count(START) != len(blocks) or page.count(END) != len(blocks):
        raise FillError("a table's marker or its end is not of the form that docs/site/fill_tables.py describes")

    def block(found: re.Match[str]) -> str:
        files = found["files"].split(", ")
        if missing_files(files, docs):
            return found[0]
        records = [record for file in files for record in records_of(file, docs)]
        return f"{found['marker']}\n{table(found['template'].splitlines(), records)}\n\n{END}"

    return MARKED.sub(block, page)


def waiting(page: str, docs: Path = DOCS) -> dict[str, str]:
    """Returns the result files of a page that do not exist yet, and the command that makes each."""
    blocks = MARKED.finditer(page)
    return {file: found["command"] for found in blocks for file in missing_files(found["files"].split(", "), docs)}


def missing_files(files: Sequence[str], docs: Path) -> list[str]:
    """Returns those of the files named in a marker that do not exist.

    Raises:
        FillError: A name is none of a result file.
    """
    for file in files:
        if not FILE.fullmatch(file):
            raise FillError(f"{file!r} is none of results/NAME.csv, results/NAME.json and results/NAME.json:KEY")
    return [file for file in files if not (docs / file.partition(":")[0]).exists()]


def records_of(file: str, docs: Path) -> Iterator[dict[str, Any]]:
    """Reads the records of a result file: numbers and texts by the names that a template may use."""
    name, _, key = file.partition(":")
    text = (docs / name).read_text(encoding="utf-8")
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


def table(template: Sequence[str], records: Sequence[Mapping[str, Any]]) -> str:
    """Returns the lines of a template with numbers filled in.

    Raises:
        FillError: An expression has no value.
    """
    by_label = {identifier(str(next(iter(record.values())))): SimpleNamespace(**record) for record in records}

    def other(label: str) -> SimpleNamespace:
        return by_label.get(identifier(label), SimpleNamespace(**dict.fromkeys(records[0], math.nan)))

    lines, names = [], [by_label]
    for line in template:
        if each := EACH.fullmatch(line):
            chosen = [record for record in records if evaluated(each["condition"] or "True", record)]
            names = [{**by_label, **record, "other": other} for record in chosen]
        else:
            lines += [re.sub(r"[+-]?\bnan\b", "–", evaluated(f"rf'''{line}'''", each_of)) for each_of in names]
            names = [by_label]
    return "\n".join(lines)


def evaluated(expression: str, names: Mapping[str, Any]) -> Any:
    """Evaluates an expression of a page, which is this repository's own code as its commands and tutorials are."""
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
        for file, command in waiting(page, docs).items():
            print(f"{name}: waits for docs/{file}, made by: {command}")
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
