"""The commands that README and pages tell a reader to type: where they stand, and how they are cut into words."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from markdown_it import MarkdownIt
from markdown_it.token import Token

ROOT = Path(__file__).parent.parent.parent
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
PROGRAMS = ("annelid", "mkdocs", "pip", "pytest", "python")
SHELLS = ("", "sh", "bash", "shell")
# A reader replaces what a page calls by a word in capitals, such as RUN or LEVEL.
SEPARATORS = ("&&", ";", "|", ">")


@dataclass(frozen=True, slots=True)
class Command:
    """One command line.

    Attributes:
        page: Path of the page, relative to the repository.
        words: The command, cut as a shell cuts it, from the program's name on.
    """

    page: str
    words: tuple[str, ...]

    @property
    def line(self) -> str:
        """The command as one would type it."""
        return shlex.join(self.words)


def commands_of(page: Path) -> list[Command]:
    """Returns the commands of a page, in order: of its shell blocks, and those that stand in a sentence."""
    tokens = MarkdownIt("commonmark").enable("table").parse(page.read_text(encoding="utf-8"))
    name = str(page.relative_to(ROOT))
    lines = (line for token in tokens for line in _command_lines(token))
    return [Command(name, words) for line in lines for words in _cut(line)]


def files_of(page: Path) -> dict[str, str]:
    """Returns the files that a page tells a reader to write: fenced blocks with a title, by that title."""
    tokens = MarkdownIt("commonmark").parse(page.read_text(encoding="utf-8"))
    titled = ((re.search(r'title="([^"]+)"', token.info), token.content) for token in tokens if token.type == "fence")
    return {match[1]: text for match, text in titled if match}


def _command_lines(token: Token) -> Iterator[str]:
    if token.type == "code_block" or (token.type == "fence" and token.info.split(" ")[0] in SHELLS):
        yield from re.sub(r"\\\n\s*", " ", token.content).splitlines()
    for child in token.children or ():
        if child.type == "code_inline":
            yield child.content.replace("\n", " ")


def _cut(line: str) -> Iterator[tuple[str, ...]]:
    """Cuts a line where a shell starts another command, and leaves out what is none of our programs'."""
    if not re.match(rf"(\S+=\S+ )*(\S*/)?({'|'.join(PROGRAMS)})( |$)", line.strip()):
        return
    lexer = shlex.shlex(line.strip(), posix=True, punctuation_chars=";|&>")
    lexer.whitespace_split = True
    lexer.commenters = ""
    words: list[str] = []
    redirected = False
    for word in (*lexer, ";"):
        if word in SEPARATORS:
            if words and not redirected and Path(words[0]).name in PROGRAMS:
                yield (Path(words[0]).name, *words[1:])
            words, redirected = [], word == ">"
        elif not (redirected and not words):
            words.append(word)
        else:
            redirected = False
