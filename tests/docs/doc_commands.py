"""What README and pages tell a reader to type: commands, Python and files, in the order in which they stand."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from markdown_it import MarkdownIt
from markdown_it.token import Token

ROOT = Path(__file__).parent.parent.parent
PAGES = {
    str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
    for path in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
}
PROGRAMS = ("annelid", "pip", "pytest", "python", "python3")
SHELLS = ("", "sh", "bash", "shell")
BETWEEN_COMMANDS = ("&&", ";", "|", ">")


@dataclass(frozen=True, slots=True)
class Command:
    """A command line, cut into words as a shell cuts it, from the program's name on."""

    words: tuple[str, ...]

    def __str__(self) -> str:
        return shlex.join(self.words)


@dataclass(frozen=True, slots=True)
class Script:
    """A block of Python."""

    code: str


@dataclass(frozen=True, slots=True)
class Written:
    """A file that the reader is told to write: a block with a title."""

    name: str
    text: str


Step = Command | Script | Written


def steps_of(page: str) -> list[Step]:
    """Returns what a page tells its reader to do, in order."""
    return steps_in(PAGES[page])


def steps_in(text: str) -> list[Step]:
    """Returns what a text tells its reader to do, in order."""
    tokens = MarkdownIt("commonmark").enable("table").parse(text)
    return [step for token in tokens for step in _steps(token)]


def commands_of(page: str) -> list[Command]:
    """Returns the commands of a page, those of its blocks and those within sentences, in order."""
    return [step for step in steps_of(page) if isinstance(step, Command)]


def _steps(token: Token) -> Iterator[Step]:
    language = token.info.split(" ")[0]
    title = re.search(r'title="([^"]+)"', token.info)
    if token.type == "fence" and title:
        yield Written(title[1], token.content)
    elif token.type == "fence" and language == "python":
        yield Script(token.content)
    elif token.type == "code_block" or (token.type == "fence" and language in SHELLS):
        for line in re.sub(r"\s*\\\n\s*", " ", token.content).splitlines():
            # What stands apart from a command says what it does.
            yield from _commands(re.split(r"\s{2,}", line.strip())[0])
    for child in token.children or ():
        # A program's bare name is no command.
        if child.type == "code_inline" and " " in child.content.strip():
            yield from _commands(child.content.replace("\n", " "))


def _commands(line: str) -> Iterator[Command]:
    """Cuts a line where a shell starts another command; what is none of our programs' is left out."""
    if not re.match(rf"(\w+=\S+ )*(\S*/)?({'|'.join(PROGRAMS)})( |$)", line.strip()):
        return
    lexer = shlex.shlex(line.strip(), posix=True, punctuation_chars=";|&>")
    lexer.whitespace_split = True
    lexer.commenters = ""
    words: list[str] = []
    for word in (*lexer, ";"):
        if word not in BETWEEN_COMMANDS:
            words.append(word)
            continue
        while words and re.fullmatch(r"\w+=.*", words[0]):
            del words[0]
        # What follows ">" is a file, and so no program of ours.
        if words and Path(words[0]).name in PROGRAMS:
            yield Command((Path(words[0]).name, *words[1:]))
        words = []
