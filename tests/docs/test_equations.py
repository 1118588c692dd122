"""The page of the equations: its functions, fields, numbers and formulas are those of the package and of the site."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import astuple
from functools import cache
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import pytest
from doc_commands import PAGES

from annelid.config import RunConfig, field_paths, load_config
from annelid.config.checking import field_value
from annelid.nervous import PeristalsisParameters
from mathematics import mathml

PAGE = PAGES["docs/explanation/equations.md"]
TEXT = re.sub(r"`[^`]*`", "", PAGE)
"""The page without code, in which a dollar is a dollar."""
SECTIONS = "|".join(sorted({path.split(".")[0] for path in field_paths() if "." in path}))
FIELDS = re.findall(rf"`((?:{SECTIONS})\.[\w.]+)`", PAGE)
FUNCTIONS = re.findall(r"\[`(annelid[\w.]+)`\]\((\S+?)#([\w.]+)\)", PAGE)


def tables() -> Iterator[tuple[list[str], list[str]]]:
    """Walks the rows of all tables, each with the header of its table."""
    header: list[str] = []
    for line in PAGE.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if not line.startswith("|"):
            header = []
        elif not header:
            header = cells
        elif not set(line) <= set("|-"):
            yield header, cells


@cache
def preset(name: str) -> RunConfig:
    return load_config(name)


def stated() -> list[tuple[str, str, str]]:
    """Returns every field with a value: the preset that has it, the field and the value."""
    found = []
    for header, cells in tables():
        if header[0] != "symbol" or not cells[-1]:
            continue
        value, own = re.fullmatch(r"(.+?)(?: \(`(.+)`\))?", cells[-1]).groups()  # type: ignore[union-attr]
        found.append((own or header[-1].strip("`"), cells[-2].strip("`"), value))
    return found


def value_of(config: RunConfig, field: str) -> Any:
    """Returns the value of a field, None where its section is not there."""
    section = field.rpartition(".")[0]
    return None if section.count(".") and field_value(config, section) is None else field_value(config, field)


def test_every_function_exists_and_its_link_leads_to_it() -> None:
    assert len(FUNCTIONS) > 30
    for name, page, anchor in FUNCTIONS:
        assert anchor == name
        assert resolve_name(name).__doc__, name
        room = name.rpartition(".")[0]
        reference = PAGES[f"docs/reference/{page.removeprefix('../reference/')}"]
        assert f"::: {name}\n" in f"{reference}\n" or f"::: {'.'.join(room.split('.')[:2])}\n" in reference


def test_every_field_exists() -> None:
    assert len(FIELDS) > 50
    assert [field for field in FIELDS if field not in field_paths()] == []


def test_values_are_those_of_the_preset() -> None:
    wrong = []
    for name, field, value in stated():
        has = value_of(preset(name), field)
        here = None if value == "not set" else value if isinstance(has, str) else json.loads(value)
        if here != (list(has) if isinstance(has, tuple) else has):
            wrong.append(f"{name}: {field} is {has}, not {value}")
    assert not wrong


def test_conductances_are_those_that_are_designed() -> None:
    shown = [float(cells[-1]) for header, cells in tables() if header[0] == "conductance"]
    assert shown == pytest.approx(astuple(PeristalsisParameters().conductances), abs=5e-7)


def test_equations_are_numbered_and_every_one_has_its_source_and_function() -> None:
    numbers = [int(number) for number in re.findall(r"\\tag\{(\d+)\} \$\$$", PAGE, re.MULTILINE)]
    assert numbers == list(range(1, PAGE.count("$$") // 2 + 1))
    explained = []
    for header, cells in tables():
        if header[0] == "equation":
            assert all(cells)
            ends = [int(number) for number in re.findall(r"\((\d+)\)", cells[0])]
            explained += range(ends[0], ends[-1] + 1)
    assert explained == numbers


def test_the_built_page_has_every_formula_as_mathml(site: Path) -> None:
    built = (site / "explanation" / "equations.html").read_text(encoding="utf-8")
    article = built.split("<article", 1)[1].split("</article>", 1)[0]
    blocks, dollars = PAGE.count("$$") // 2, TEXT.replace("$$", "").count("$")
    assert dollars % 2 == 0
    assert article.count('display="block"') == blocks
    assert article.count("<math") == blocks + dollars // 2
    assert [f'id="equation-{number}"' in article for number in range(1, blocks + 1)] == [True] * blocks
    assert re.findall(r"[\\$]", article) == []


def test_what_cannot_be_converted_ends_the_build() -> None:
    for latex in (r"\nosuchcommand x", r"\begin{aligned} a &= b \end{aligned}"):
        with pytest.raises(ValueError, match="MathML"):
            mathml(latex, "block")
