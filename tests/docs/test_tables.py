"""Tables of numbers are filled from result files: page and file agree, and no table of numbers stands without its file."""

from __future__ import annotations

import re
import shlex
import tomllib
from pathlib import Path

import pytest
from doc_commands import PAGES, ROOT, Command
from markdown_it import MarkdownIt
from test_doc_commands import check_annelid, check_program

from fill_tables import DOCS, MARKED, FillError, filled, waiting

MOST = 5
"""Cells with a number that a table may have without being one of results."""
NUMBER = re.compile(r"^[-+~*≤<>]*\d[\d.,]*\b(?!-)")

WAITING = {}
"""Result files that do not exist yet."""

EXCEPTIONS = {}
"""Tables of numbers without a result file, by page and head of the first two columns, and why."""


def tables_of(text: str) -> list[list[list[str]]]:
    """Cells of all tables of a page, row by row, without code."""
    tables: list[list[list[str]]] = []
    for token in MarkdownIt("commonmark").enable("table").parse(text):
        if token.type == "table_open":
            tables.append([])
        elif token.type == "tr_open":
            tables[-1].append([])
        elif token.type == "inline" and tables and token.map is None:
            tables[-1][-1].append(re.sub(r"`[^`]*`", "", token.content))
    return tables
