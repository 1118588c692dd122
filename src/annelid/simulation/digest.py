"""The digest of a finished run file, by which damage is noticed before anything reads the file.

It lies behind the HDF5 data, where HDF5 does not look, in room that is there from the start: a table of SHA-256 sums,
one line for each variable and one for all other bytes, and a footer with the sum of the table. So it covers every
byte. The sum in the footer is written last and is zero until then: a run that was killed carries none. It shows damage,
not forgery: whoever changes a file on purpose can write another digest.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import BinaryIO, Literal, NamedTuple
from urllib.parse import quote, unquote

Extent = tuple[int, int]
"""Where a variable lies in the file: its offset and its length, bytes."""
REST = "metadata and labels"
_MAGIC = b"annelid digest 1"
_FOOTER = struct.Struct("<16sQQ32s")  # magic, bytes before the table, bytes of the table, SHA-256 of the table
_UNFINISHED = bytes(32)
_CHUNK = 1 << 20
_LONGEST_TABLE = 1 << 24


class Finding(NamedTuple):
    """What the digest says of a file: there is none ("absent"), or room for one ("unfinished"), or it was compared."""

    state: Literal["intact", "damaged", "unfinished", "absent"]
    damaged: tuple[str, ...] = ()  # what differs from it: names of variables, REST or "the digest itself"


_DAMAGED = Finding("damaged", ("the digest itself",))


def room(extents: Mapping[str, Extent], end: int) -> bytes:
    """Returns the bytes to append to a file of ``end`` bytes, to be overwritten by `write`."""
    length = len(_table(dict.fromkeys([*extents, ""], "0" * 64), extents, end))
    return bytes(length) + _FOOTER.pack(_MAGIC, end, length, _UNFINISHED)


def write(file: BinaryIO, extents: Mapping[str, Extent]) -> None:
    """Fills the room, made with the same extents, with the digest of an open file that does not change any more."""
    file.seek(-_FOOTER.size, 2)
    _, end, _, _ = _FOOTER.unpack(file.read(_FOOTER.size))
    table = _table(_sums(file, extents, end), extents, end)
    file.seek(end)
    # In two pieces, so that a kill can leave no half of a footer.
    for content in (table, _FOOTER.pack(_MAGIC, end, len(table), hashlib.sha256(table).digest())):
        write_whole(file, content)


def write_whole(file: BinaryIO, content: bytes) -> None:
    """Writes all of some bytes to an unbuffered file, which may take a part at a time."""
    rest = memoryview(content)
    while rest:
        rest = rest[file.write(rest) :]


def examine(path: Path, *, footer_only: bool = False) -> Finding:
    """Compares a file with its digest, or only looks whether it has one: a finished one then counts as intact."""
    with open(path, "rb") as file:
        size = file.seek(0, 2)
        if size < _FOOTER.size:
            return Finding("absent")
        file.seek(size - _FOOTER.size)
        magic, end, length, total = _FOOTER.unpack(file.read(_FOOTER.size))
        if magic != _MAGIC:
            return Finding("absent")
        if end + length + _FOOTER.size != size or length > _LONGEST_TABLE:
            return _DAMAGED
        if total == _UNFINISHED:
            return Finding("unfinished")
        if footer_only:
            return Finding("intact")
        file.seek(end)
        table = file.read(length)
        try:
            expected, extents = _read_table(table, end)
        except ValueError:
            return _DAMAGED
        sums = _sums(file, extents, end)
        damaged = tuple(name or REST for name, digest in expected.items() if sums[name] != digest)
        if damaged:
            return Finding("damaged", damaged)
        return Finding("intact") if hashlib.sha256(table).digest() == total else _DAMAGED


def _sums(file: BinaryIO, extents: Mapping[str, Extent], end: int) -> dict[str, str]:
    """Returns the sum of each variable, and under an empty name that of all other bytes before ``end``."""
    rest, sums, position = hashlib.sha256(), {}, 0
    for name, (offset, length) in sorted([*extents.items(), ("", (end, 0))], key=lambda item: item[1]):
        for chunk in _read(file, position, offset):
            rest.update(chunk)
        own, position = hashlib.sha256(), offset + length
        for chunk in _read(file, offset, position):
            own.update(chunk)
        sums[name] = own.hexdigest()
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
    """Returns sums and extents of a table; ValueError where it is none, or names bytes that are not there or twice."""
    sums: dict[str, str] = {}
    extents: dict[str, Extent] = {}
    for line in filter(None, table.decode("ascii").split("\n")):
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
