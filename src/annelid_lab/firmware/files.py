"""The files of firmware: their texts, how templates are filled, and names as C may have them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files as package_files
from pathlib import Path
from string import Template
from typing import Any, Literal

from annelid.errors import ConfigError, RunFileError
from annelid.output import write_text

Real = Literal["double", "float"]
LONGEST_LABEL = 40
_UNSAFE = re.compile(r"[^A-Za-z0-9 _.,:;()+=-]")


@dataclass(frozen=True)
class Firmware:
    """C99 of a network or a controller, and what a program on this machine needs to know of it.

    Attributes:
        name: What its files are called and everything global in them begins with.
        header: Text of ``name.h``.
        source: Text of ``name.c``.
        self_test: Text of ``name_selftest.c``.
        real: Type of all numbers.
        sensors: Names and shapes of what a step is given, in the order in the struct, which has nothing else.
        returned: Name and length of what it returns.
        neurons: Names of the neurons, in the order in ``potential_mV``, with which the struct of the state begins.
        wire: Of a controller: texts of ``name_wire.h`` and ``name_wire.c``, which answer annelid over a line.
    """

    name: str
    header: str
    source: str
    self_test: str
    real: Real
    sensors: Mapping[str, tuple[int, ...]]
    returned: tuple[str, int]
    neurons: tuple[str, ...]
    wire: tuple[str, ...] = ()

    def write(self, folder: str | Path, *, overwrite: bool = False, wire: bool = False) -> list[Path]:
        """Writes the three files, and those of the wire if asked for, into a folder, which is made if it is not there.

        Returns:
            Their paths.

        Raises:
            ConfigError: The wire of what has none is asked for.
            RunFileError: A file exists, unless it may be overwritten, or cannot be written.
        """
        if wire and not self.wire:
            raise ConfigError(
                "only a whole controller answers over the wire, not a network alone, and none of more than 256 numbers"
            )
        folder, texts = Path(folder), {".h": self.header, ".c": self.source, "_selftest.c": self.self_test}
        if wire:
            texts |= dict(zip(("_wire.h", "_wire.c"), self.wire, strict=True))
        files = {folder / f"{self.name}{ending}": text for ending, text in texts.items()}
        for path in files:
            if path.exists() and not overwrite:
                raise RunFileError(f"{path} exists: name another folder, or overwrite it (--force)")
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RunFileError(f"cannot make the folder {folder}: {error.strerror}") from None
        return [write_text(path, text) for path, text in files.items()]


def identifier(text: str, longest: int = LONGEST_LABEL) -> str:
    """Returns the letters, digits and underscores of a text, with an underscore for every other character."""
    return re.sub(r"[^A-Za-z0-9_]", "_", text)[:longest] or "_"


def comment(text: str) -> str:
    """Returns a text as it may stand in a comment: no character that could end it, or that a compiler replaces."""
    return _UNSAFE.sub("_", text)[: LONGEST_LABEL * 2]


def filled(template: str, words: Mapping[str, Any]) -> str:
    """Fills a template: lines between ``@if word`` and ``@end`` stay where the word is true, ``$word`` is replaced."""
    lines: list[str] = []
    stays: list[bool] = []
    for line in package_files("annelid_lab.firmware").joinpath(template).read_text(encoding="utf-8").splitlines():
        if line.startswith("@if "):
            stays.append(bool(words[line.removeprefix("@if ")]))
        elif line == "@end":
            stays.pop()
        elif all(stays):
            lines.append(Template(line).substitute(words))
    return re.sub(r"\n{3,}", "\n\n", "\n".join(lines)) + "\n"
