"""The digest of a finished run file, by which damage is noticed before anything reads the file.

It lies behind the HDF5 data, where HDF5 does not look, in room that is there from the start: the SHA-256 of all bytes
before it. It is written last and is zero until then: a run that was killed carries none. It shows damage, not forgery:
whoever changes a file on purpose can write another digest.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import BinaryIO, Literal

State = Literal["intact", "damaged", "unfinished", "old", "absent"]
"""What the digest says of a file: there is none ("absent"), room for one ("unfinished"), one of annelid 0.2 that is not
compared any more ("old"), or it was compared."""
_MAGIC = b"annelid digest 2".ljust(32)
_LENGTH = 32
_FOOTER_LENGTH = len(_MAGIC) + _LENGTH
_UNFINISHED = bytes(_LENGTH)
_CHUNK = 1 << 20
_OLD_MAGIC = b"annelid digest 1"


def room(end: int) -> bytes:
    """Returns the bytes to append to a file of ``end`` bytes, so that the digest lies in one page of memory."""
    return bytes(-end % _FOOTER_LENGTH) + _MAGIC + _UNFINISHED


def write(file: BinaryIO) -> None:
    """Fills the room with the digest of an open file that does not change any more."""
    place = file.seek(-_LENGTH, 2)
    digest = _sum(file, place)
    file.seek(place)
    write_whole(file, digest)


def write_whole(file: BinaryIO, content: bytes) -> None:
    """Writes all of some bytes to an unbuffered file, which may take a part at a time."""
    rest = memoryview(content)
    while rest:
        rest = rest[file.write(rest) :]


def examine(path: Path, *, compared: bool = True) -> State:
    """Compares a file with its digest, or only looks whether it has one: a finished one then counts as intact."""
    with open(path, "rb") as file:
        place = file.seek(0, 2) - _LENGTH
        if place < len(_MAGIC):
            return "absent"
        file.seek(place - len(_MAGIC))
        magic, digest = file.read(len(_MAGIC)), file.read(_LENGTH)
        if magic != _MAGIC:
            return "old" if magic.startswith(_OLD_MAGIC) else "absent"
        if digest == _UNFINISHED:
            return "unfinished"
        if not compared:
            return "intact"
        return "intact" if _sum(file, place) == digest else "damaged"


def _sum(file: BinaryIO, stop: int) -> bytes:
    found, start = hashlib.sha256(), 0
    file.seek(0)
    while start < stop:
        chunk = file.read(min(_CHUNK, stop - start))
        if not chunk:
            raise OSError(5, "the file became shorter while it was read")
        found.update(chunk)
        start += len(chunk)
    return found.digest()
