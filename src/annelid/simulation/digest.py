"""The digest of a finished run file, by which damage is noticed before anything reads the file.

It lies behind the HDF5 data, where HDF5 does not look, in room that is there from the start: a table of SHA-256 sums,
one line for each variable and one for all other bytes, and a footer with the sum of the table. So it covers every
byte. The sum in the footer is written last and is zero until then: a run that was killed carries none. It tells damage,
not forgery: whoever changes a file on purpose can write another digest.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Literal
from urllib.parse import quote, unquote

Extent = tuple[int, int]
"""Where a variable lies in the file: its offset and its length, bytes."""

REST = "metadata and labels"

_MAGIC = b"annelid digest 1"
_FOOTER = struct.Struct("<16sQQ32s")  # magic, bytes before the table, bytes of the table, SHA-256 of the table
_UNFINISHED = bytes(32)
_CHUNK = 1 << 20
_LONGEST_TABLE = 1 << 24


@dataclass(frozen=True, slots=True)
class Finding:
    """What the digest says of a file.

    Attributes:
        state: ``"absent"`` where there is none, ``"unfinished"`` where there is room for one.
        damaged: What differs from the digest: names of variables, `REST` or "the digest itself".
    """

    state: Literal["intact", "damaged", "unfinished", "absent"]
    damaged: tuple[str, ...] = ()


def room(extents: Mapping[str, Extent], end: int) -> bytes:
    """Returns the bytes to append to a file of ``end`` bytes, to be overwritten by `write`."""
    length = len(_table(dict.fromkeys([*extents, ""], "0" * 64), extents, end))
    return bytes(length) + _FOOTER.pack(_MAGIC, end, length, _UNFINISHED)


def write(file: BinaryIO, extents: Mapping[str, Extent]) -> None:
    """Fills the room with the digest of a file that does not change any more.

    Args:
        file: The file, open for reading and writing.
        extents: As given to `room`.
    """
    position = file.seek(0, 2) - _FOOTER.size
    file.seek(position)
    _, end, _, _ = _FOOTER.unpack(file.read(_FOOTER.size))
    table = _table(_sums(file, extents, end), extents, end)
    file.seek(end)
    rest = memoryview(table + _FOOTER.pack(_MAGIC, end, len(table), hashlib.sha256(table).digest()))
    # In two pieces, so that a kill can leave no half of a footer.
    for piece in (rest[: len(table)], rest[len(table) :]):
        while piece:
            piece = piece[file.write(piece) :]


def examine(path: Path, *, footer_only: bool = False) -> Finding:
    """Compares a file with its digest.

    Args:
        path: The file.
        footer_only: Tell only whether there is a digest, without reading the file: a finished one counts as intact.

    Raises:
        OSError: The file cannot be read.
    """
    with open(path, "rb") as file:
        size = file.seek(0, 2)
        if size < _FOOTER.size:
            return Finding("absent")
        file.seek(size - _FOOTER.size)
        magic, end, length, total = _FOOTER.unpack(file.read(_FOOTER.size))
        if magic != _MAGIC:
            return Finding("absent")
        if end + length + _FOOTER.size != size or length > _LONGEST_TABLE:
            return Finding("damaged", ("the digest itself",))
        if total == _UNFINISHED:
            return Finding("unfinished")
        if footer_only:
            return Finding("intact")
        file.seek(end)
        table = file.read(length)
        try:
            expected, extents = _read_table(table, end)
        except ValueError:
            return Finding("damaged", ("the digest itself",))
        sums = _sums(file, extents, end)
        damaged = [name or REST for name, digest in expected.items() if sums[name] != digest]
        if not damaged and hashlib.sha256(table).digest() != total:
            damaged = ["the digest itself"]
        return Finding("damaged" if damaged else "intact", tuple(damaged))


def _sums(file: BinaryIO, extents: Mapping[str, Extent], end: int) -> dict[str, str]:
    """Returns the sum of each variable, and under an empty name that of all other bytes before ``end``."""
    rest, sums, position = hashlib.sha256(), {}, 0
    for name, (offset, length) in sorted(extents.items(), key=lambda item: item[1]):
        for chunk in _read(file, position, offset):
            rest.update(chunk)
        own, position = hashlib.sha256(), offset + length
        for chunk in _read(file, offset, position):
            own.update(chunk)
        sums[name] = own.hexdigest()
    for chunk in _read(file, position, end):
        rest.update(chunk)
    return sums | {"": rest.hexdigest()}


def _read(file: BinaryIO, start: int, stop: int) -> Iterator[bytes]:
    file.seek(start)
    while start < stop:
        chunk = file.read(min(_CHUNK, stop - start))
        if not chunk:
            raise OSError(5, "the file became shorter while it was read")
        yield chunk
        start += len(chunk)


def _table(sums: Mapping[str, str], extents: Mapping[str, Extent], end: int) -> bytes:
    """Returns the table, padded so that the footer begins at a multiple of its size and lies in one page of memory."""
    lines = (
        f"{digest} {offset} {length} {quote(name, safe='/')}\n"
        for name, digest in sums.items()
        for offset, length in [extents.get(name, (0, end))]
    )
    text = "".join(lines).encode()
    return text + b"\n" * (-(end + len(text)) % _FOOTER.size)


def _read_table(table: bytes, end: int) -> tuple[dict[str, str], dict[str, Extent]]:
    """Returns the sums and the extents of a table.

    Raises:
        ValueError: It is no such table, or names bytes that are not there or twice.
    """
    sums: dict[str, str] = {}
    extents: dict[str, Extent] = {}
    for line in table.decode("ascii").split("\n"):
        if line:
            digest, offset, length, name = line.split(" ")
            name = unquote(name, errors="strict")
            sums[name] = digest
            if name:
                extents[name] = int(offset), int(length)
    position = 0
    for offset, length in sorted(extents.values()):
        if offset < position or length < 0:
            raise ValueError("two variables overlap")
        position = offset + length
    if position > end or "" not in sums:
        raise ValueError("a variable lies outside the file")
    return sums, extents
