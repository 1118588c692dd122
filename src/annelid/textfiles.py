"""The one reader and the one writer of TOML and JSON, and a reader of XML; all are bounded in size and depth."""

from __future__ import annotations

import json
import re
import stat
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from numbers import Real
from pathlib import Path
from typing import Any

from annelid.errors import ConfigError, UnreadableText, shortened
from annelid.text import printable

__all__ = [
    "check_depth",
    "line_of",
    "parse_toml",
    "parse_xml",
    "read_bytes",
    "read_json",
    "read_text",
    "read_toml",
    "tag_of",
    "toml_text",
    "toml_value",
]

MOST_BYTES = 8_000_000
"""Of a text that is read; the longest one that annelid writes, a network of 200 segments, has 6 MB."""
MOST_LEVELS = 64
"""Tables and lists within each other, and parts of a dotted key."""

# The parser takes time that grows with the square of a key's parts, so long keys are found before it sees them. As many
# words and dots in a text that is no key are refused, too.
_KEY_PARTS = re.compile(r"""(?<![\w\\-])(?:(?:[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+)++""")


def read_text(path: Path, what: str = "") -> str:
    """Reads a text file, with or without a byte order mark; ``what`` it is, if more than a file, is for the sentence.

    Raises:
        UnreadableText: It cannot be read, is no regular file, is longer than `MOST_BYTES`, or is not UTF-8.
    """
    content = read_bytes(path, what)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        named = f"{what} {path}".strip()
        raise UnreadableText(f"cannot read {named}: it is not UTF-8 at byte {error.start}") from None
    return text


def read_bytes(path: Path, what: str = "", most: int = MOST_BYTES) -> bytes:
    """Reads a file of at most so many bytes; raises as `read_text`."""
    named = f"{what} {path}".strip()
    try:
        # Asked first, since opening a pipe would wait for a writer.
        if not stat.S_ISREG(path.stat().st_mode):
            raise UnreadableText(f"cannot read {named}: it is a folder, a pipe or a device, not a file")
        with path.open("rb") as file:
            content = file.read(most + 1)
    except OSError as error:
        raise UnreadableText(f"cannot read {named}: {error.strerror}") from None
    except ValueError as error:
        raise UnreadableText(f"cannot read {shortened(named)!r}: {error}") from None
    if len(content) > most:
        raise _too_long(str(path), most)
    return content


def read_toml(path: Path, what: str = "the configuration file") -> dict[str, Any]:
    """Reads a TOML file, as `read_text` and `parse_toml` do."""
    return parse_toml(read_text(path, what), str(path))


def read_json(path: Path, what: str = "") -> Any:
    """Reads a JSON file, as `read_text` and `parse_json` do."""
    return parse_json(read_text(path, what), str(path))


def parse_toml(text: str, name: str) -> dict[str, Any]:
    """Reads TOML that an `UnreadableText` calls by a name where it is not valid, too long or too deep."""

    def load(text: str) -> dict[str, Any]:
        if any(parts[0].count(".") >= MOST_LEVELS for parts in _KEY_PARTS.finditer(text)):
            raise RecursionError
        return tomllib.loads(text)

    return _parsed(load, "TOML", text, name)


def parse_json(text: str, name: str) -> Any:
    """Reads JSON, as `parse_toml` reads TOML."""
    return _parsed(json.loads, "JSON", text, name)


def _parsed(load: Callable[[str], Any], language: str, text: str, name: str) -> Any:
    if len(text) > MOST_BYTES:
        raise _too_long(name, MOST_BYTES)
    try:
        tree = load(text)
    except ValueError as error:
        raise UnreadableText(f"{name} is not valid {language}: {shortened(str(error))}") from None
    except RecursionError:
        raise _too_deep(name) from None
    check_depth(tree, name)
    return tree


class _Element(ET.Element):
    """An element that knows the line in which its start ends."""

    line = 0


class _XmlBuilder(ET.TreeBuilder):
    """Builds the tree of a text that is bounded in elements and depth and has no document type, hence no entities."""

    line = 0
    """The one that is being read."""

    def __init__(self, what: str, most_elements: int, most_levels: int) -> None:
        super().__init__(element_factory=_Element)
        self._what, self._most_elements, self._most_levels = what, most_elements, most_levels
        self._elements = self._level = 0

    def doctype(self, *_: object) -> None:
        raise ConfigError(f"has a document type (<!DOCTYPE ..>), which {self._what} cannot have: remove it")

    def start(self, tag: str, attrs: dict[str, str]) -> ET.Element:  # pyright: ignore[reportIncompatibleMethodOverride]
        self._elements, self._level = self._elements + 1, self._level + 1
        if self._elements > self._most_elements:
            raise ConfigError(f"has more than {self._most_elements:,} elements, the most of {self._what}")
        if self._level > self._most_levels:
            raise ConfigError(f"is nested deeper than {self._most_levels} levels, the most of {self._what}")
        element = super().start(tag, attrs)
        assert isinstance(element, _Element)
        element.line = self.line
        return element

    def end(self, tag: str) -> ET.Element:
        self._level -= 1
        return super().end(tag)


def parse_xml(text: str | bytes, what: str, most_elements: int, most_levels: int) -> ET.Element:
    """Reads XML without a document type, hence without entities; ``what`` it is stands in the sentences.

    Raises:
        ConfigError: It is no XML, has a document type, or more elements or levels than so many.
    """
    builder = _XmlBuilder(what, most_elements, most_levels)
    parser = ET.XMLParser(target=builder)
    try:
        # Line by line, so that elements know theirs. UTF-16 has its line feeds elsewhere.
        flush = getattr(parser, "flush", lambda: None)  # Newer parsers put off what is not complete.
        for builder.line, line in enumerate(text.splitlines(keepends=True), start=1):
            parser.feed(line)
            flush()
        return parser.close()
    except (ET.ParseError, ValueError, LookupError) as error:
        raise ConfigError(f"is not valid XML: {shortened(str(error))}") from None


def tag_of(element: ET.Element) -> str:
    """Returns how an error names an element that `parse_xml` has read: its tag, after its line where that is known."""
    line = line_of(element)
    return f"line {line}: <{element.tag}" if line else f"<{element.tag}"


def line_of(element: ET.Element) -> int:
    """Returns the line of an element that `parse_xml` has read, 0 where it is not known."""
    return getattr(element, "line", 0)


def check_depth(tree: Any, name: str) -> None:
    """Refuses lists and mappings nested deeper than `MOST_LEVELS`, such as one that contains itself."""
    open_nodes = [(tree, 0)]
    while open_nodes:
        node, level = open_nodes.pop()
        if level > MOST_LEVELS:
            raise _too_deep(name)
        inner = node.values() if isinstance(node, Mapping) else node if isinstance(node, list | tuple) else ()
        open_nodes.extend((each, level + 1) for each in inner)


def toml_text(tree: Mapping[str, Any], heading: str = "") -> str:
    """Writes a TOML document, of which `parse_toml` makes the same tree; None is left out, a heading is a comment."""
    import tomlkit

    document = tomlkit.document()
    for line in heading.splitlines():
        # A comment may have no control characters, and a file no half of a pair of surrogates.
        document.add(tomlkit.comment(printable(line)))
    document.update(_plain(tree))
    return tomlkit.dumps(document)


def toml_value(value: Any) -> str:
    """Writes one value as TOML on one line, as it may stand behind a ``field =``."""
    import tomlkit

    # Within a list a table is written inline.
    values = tomlkit.array()
    values.append(_plain(value))
    return values[0].as_string()


def nested(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Makes a tree of values given by dotted path; a later one goes over, or into, an earlier one."""
    tree: dict[str, Any] = {}
    for path, value in fields.items():
        *sections, field = path.split(".")
        level = tree
        for section in sections:
            level = level.setdefault(section, {})
        level[field] = _plain(value)
    return tree


def _plain(value: Any) -> Any:
    """Turns tuples into lists and sections into tables, and leaves None out, which TOML has not."""
    if hasattr(value, "model_dump"):
        value = value.model_dump()
    if isinstance(value, Mapping):
        return {name: _plain(item) for name, item in value.items() if item is not None}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    # numpy's numbers among them.
    return float(value) if isinstance(value, Real) and not isinstance(value, int | float) else value


def _too_long(name: str, most: int) -> UnreadableText:
    return UnreadableText(f"{shortened(name)} is too long: more than {most / 1e6:g} MB are not read")


def _too_deep(name: str) -> UnreadableText:
    return UnreadableText(f"{shortened(name)} is nested too deeply: more than {MOST_LEVELS} levels are not read")
