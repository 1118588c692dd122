"""Pages, README and command help are in the field's standard terms, in sentences that are read once."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

import pytest
from doc_commands import PAGES as MARKDOWN
from doc_commands import ROOT
from markdown_it import MarkdownIt
from markdown_it.token import Token
from typer.main import get_command

from annelid.cli import app

NOTEBOOK = "docs/tutorials/quick_start.ipynb"


def words_of_notebook() -> str:
    """Returns the cells of the notebook that are no code, one below the other."""
    cells = json.loads((ROOT / NOTEBOOK).read_text(encoding="utf-8"))["cells"]
    return "\n\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")


PAGES = MARKDOWN | {NOTEBOOK: words_of_notebook()}
WORDS = {
    r"pins? that (hold|give)s?": "rigid crossings, soft crossings",
    r"slip per way": "slip ratio",
    r"told for": "computed over",
    r"number that (cannot|can) be told": "that can be computed",
    r"(whole|full) cycles": "complete cycles",
    r"(drawn|worms) about (it|this one)": "Monte Carlo samples",
    r"how a worm gets along": "locomotion metrics",
    r"rooms? of the house": "package layout",
    r"(bring|brings|brought) (it |them |\w+ )?home": "fetch results",
    r"(sum of the )?ways? (towards the front|forwards)": "forward travel, forward displacement",
    r"muscles a segment": "muscles per segment",
    r"a (row|page|line|number) a \w+": "one row per run",
    r"for (good|ever)": "permanently, without end",
}
"""What stood for a standard term once, as patterns, and the term."""

LONGEST, LONGEST_FOR_USERS = 45, 30
"""Words of a sentence, in the evidence and in all else; a formula is one word."""

LONG_SENTENCES = (
    "docs/evidence/paper.md",
    "docs/evidence/slip.md",
    "docs/evidence/validation.md",
)
"""Pages that still have longer sentences: the list may only become shorter."""

FORMULA = re.compile(r"(\$\$?)[^$]+\1")
ENDS = re.compile(r"[.!?][)*\"']*\s+")


def prose(page: str) -> Iterator[tuple[str, str]]:
    """Walks the texts of a page, each with the kind of block it is in: code is one word, links are their texts."""
    blocks: list[str] = []
    for token in tokens(page):
        if token.nesting == 1:
            blocks.append(token.type.removesuffix("_open"))
        elif token.nesting == -1:
            blocks.pop()
        elif token.type == "inline":
            kinds = {"table", "heading", "blockquote"}.intersection(blocks)
            yield next(iter(kinds), "paragraph"), FORMULA.sub("FORMULA", "".join(map(text_of, token.children or ())))


def tokens(page: str) -> list[Token]:
    """Returns the blocks of a page, without the header of a notebook."""
    text = re.sub(r"\A---\n.*?\n---\n", "", PAGES[page], flags=re.DOTALL)
    return MarkdownIt("commonmark").enable("table").parse(text)


def text_of(token: Token) -> str:
    """Returns the words of a part of a text."""
    if token.type == "code_inline":
        return "CODE"
    return " " if token.type in ("softbreak", "hardbreak") else token.content


def long_sentences(page: str, longest: int = LONGEST) -> list[str]:
    """Returns the sentences of a page, outside of its tables and code, that have too many words."""
    return [each for kind, text in prose(page) if kind != "table" for each in too_long(text, longest)]


def too_long(text: str, longest: int = LONGEST_FOR_USERS) -> list[str]:
    """Returns the sentences of a text that have too many words."""
    return [each for each in ENDS.split(text) if len(each.split()) > longest]


def found_in(text: str) -> list[str]:
    """Returns what is found in a text of the words that it must not have, each with the word to use."""
    line = " ".join(text.split())
    return [
        f"{found[0]!r}: {better}"
        for pattern, better in WORDS.items()
        for found in re.finditer(rf"\b{pattern}\b", line, re.IGNORECASE)
    ]


def helps(command: Any, name: str) -> Iterator[tuple[str, str]]:
    """Walks the help texts of a command, its options and the commands below it, each with the name of its command."""
    # What stands below \b are examples, and not sentences.
    yield from ((name, " ".join(text.split())) for text in (command.help or "").split("\n\n") if text[0] != "\b")
    for parameter in command.params:
        yield name, getattr(parameter, "help", None) or ""
    for below, each in getattr(command, "commands", {}).items():
        yield from helps(each, f"{name} {below}")


def printed_helps(command: Any, name: str, parent: Any = None) -> Iterator[tuple[str, str]]:
    """Walks the lines that a command and those below it print with --help, each with the name of its command."""
    with command.make_context(name, [], parent=parent, resilient_parsing=True) as context:
        yield from ((name, line) for line in command.get_help(context).splitlines())
        for below, each in getattr(command, "commands", {}).items():
            yield from printed_helps(each, below, context)


def beginning(page: str) -> list[str]:
    """Returns what a page begins with: a heading and a paragraph are as they should be."""
    blocks = [token for token in tokens(page) if token.level == 0 and token.nesting >= 0 and token.type != "html_block"]
    return [blocks[0].tag, blocks[1].type]


def test_pages_have_standard_terms() -> None:
    assert [(page, found) for page in PAGES for _, text in prose(page) for found in found_in(text)] == []


def test_command_help_has_standard_terms() -> None:
    assert [(name, found) for name, text in helps(get_command(app), "annelid") for found in found_in(text)] == []


def test_only_listed_pages_have_long_sentences() -> None:
    assert {page for page in PAGES if long_sentences(page)} == set(LONG_SENTENCES)


def test_what_users_read_has_short_sentences() -> None:
    found = [(name, each) for name, text in helps(get_command(app), "annelid") for each in too_long(text)]
    pages = [page for page in PAGES if not page.startswith("docs/evidence/")]
    assert found + [(page, each) for page in pages for each in long_sentences(page, LONGEST_FOR_USERS)] == []


def test_every_help_fits_80_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert [(name, line) for name, line in printed_helps(get_command(app), "annelid") if len(line) > 80] == []


def test_pages_begin_with_what_they_are_for() -> None:
    assert [page for page in PAGES if beginning(page) != ["h1", "paragraph_open"]] == []
