"""The frames of the wire between annelid and a robot or firmware: docs/wire.md is their description."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike

from annelid.control import SENSED
from annelid.errors import ConfigError, suggest
from annelid.protocols import Array

VERSION = 1
MOST_NUMBERS = 256
"""In the payload of a frame."""
MOST_STEPS = 1000
"""Control steps that one exchange may stand for."""
_HEADER = struct.Struct("<BBHHH")
_CHECKSUM = struct.Struct("<I")
_HELLO = struct.Struct("<BHHHHHI")
_LEAST = _HEADER.size + _CHECKSUM.size
MOST_BYTES = _LEAST + 4 * MOST_NUMBERS
"""Of a frame before its bytes are stuffed."""


class Kind(IntEnum):
    """What a frame is."""

    HELLO = 1
    SENSATION = 2
    ACTIVATION = 3
    STOP = 4
    ERROR = 5


class Role(IntEnum):
    """Who says hello."""

    HOST = 0
    BODY = 1
    CONTROLLER = 2


class FrameError(ValueError):
    """Bytes that are no valid frame; the text completes "a frame with .."."""


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame.

    Attributes:
        kind: What it is.
        session: Number of the session, 0 .. 65535, which the host draws.
        sequence: Number of the frame that began the exchange, 0 .. 65535, then from 0 again.
        payload: Its content.
    """

    kind: Kind
    session: int
    sequence: int
    payload: bytes = b""

    def encoded(self) -> bytes:
        """Returns the bytes for the line: a zero, bytes that are none, a zero."""
        head = _HEADER.pack(VERSION, self.kind, self.session, self.sequence, len(self.payload))
        whole = head + self.payload
        # The zero before it ends what is left of a frame that was cut.
        return b"\0" + stuffed(whole + _CHECKSUM.pack(zlib.crc32(whole))) + b"\0"

    def numbers(self, n: int) -> Array:
        """Returns a payload of ``n`` numbers; `FrameError` where these are not finite, or not so many."""
        if len(self.payload) != 4 * n:
            raise FrameError(f"{len(self.payload)} bytes of numbers, not {4 * n}")
        values = np.frombuffer(self.payload, dtype="<f4").astype(np.float64)
        if not np.isfinite(values).all():
            raise FrameError("numbers that are not finite")
        return values


def packed(values: ArrayLike) -> bytes:
    """Returns numbers as a payload: 32-bit floats, the lowest byte first."""
    return np.asarray(values, dtype="<f4").tobytes()


def decoded(raw: bytes) -> Frame:
    """Returns the frame of the bytes between two zeros; `FrameError` where they are none."""
    whole = unstuffed(raw)
    if not _LEAST <= len(whole) <= MOST_BYTES:
        raise FrameError("a wrong length")
    (checksum,) = _CHECKSUM.unpack(whole[-_CHECKSUM.size :])
    if zlib.crc32(whole[: -_CHECKSUM.size]) != checksum:
        raise FrameError("a wrong checksum")
    version, kind, session, sequence, length = _HEADER.unpack_from(whole)
    if version != VERSION:
        raise FrameError(f"version {version} of the protocol, not {VERSION}")
    if length != len(whole) - _LEAST:
        raise FrameError("a wrong length")
    if kind not in list(Kind):
        raise FrameError(f"the unknown kind {kind}")
    return Frame(Kind(kind), session, sequence, whole[_HEADER.size : -_CHECKSUM.size])


def stuffed(data: bytes) -> bytes:
    """Returns bytes without a zero among them (consistent overhead byte stuffing, Cheshire and Baker 1999)."""
    result = bytearray()
    for block in data.split(b"\0"):
        while len(block) >= 254:
            result += b"\xff" + block[:254]
            block = block[254:]
        result.append(len(block) + 1)
        result += block
    return bytes(result)


def most_stuffed(n_bytes: int) -> int:
    """Returns how long so many bytes are at most once they are `stuffed`."""
    return n_bytes + n_bytes // 254 + 1


def unstuffed(data: bytes) -> bytes:
    """Returns what `stuffed` was given; `FrameError` where the blocks do not fit together."""
    result, place = bytearray(), 0
    while place < len(data):
        code = data[place]
        if code == 0 or place + code > len(data):
            raise FrameError("a part missing")
        result += data[place + 1 : place + code]
        place += code
        if code < 255 and place < len(data):
            result.append(0)
    return bytes(result)


@dataclass(slots=True)
class Decoder:
    """Finds frames in what comes over a line; holds no more than one frame.

    Attributes:
        rejected: How many were not valid, by what was wrong.
    """

    rejected: Counter[str] = field(default_factory=Counter)
    _held: bytearray = field(default_factory=bytearray)
    _is_long: bool = False

    def feed(self, data: bytes) -> Iterator[Frame]:
        """Yields the valid frames that end in these bytes."""
        *ends, rest = data.split(b"\0")
        for part in ends:
            self._hold(part)
            raw, is_long = bytes(self._held), self._is_long
            self._held.clear()
            self._is_long = False
            if is_long:
                self.reject("a wrong length")
            elif raw:
                try:
                    yield decoded(raw)
                except FrameError as error:
                    self.reject(str(error))
        self._hold(rest)

    def reject(self, reason: str) -> None:
        """Counts a frame that is not valid."""
        # A line that sends every version and kind there is must not fill the memory.
        self.rejected[reason if reason in self.rejected or len(self.rejected) < 16 else "other errors"] += 1

    def _hold(self, part: bytes) -> None:
        self._is_long |= len(self._held) + len(part) > most_stuffed(MOST_BYTES)
        if not self._is_long:
            self._held += part


@dataclass(frozen=True, slots=True)
class Interface:
    """What passes between a body and a controller, the same on both sides.

    Attributes:
        senses: What the controller is given, names in `annelid.control.SENSED`, in the order in the frame.
        n_segments: Segments.
        n_muscles: Muscles.
        timestep_us: Control step, microseconds.

    Raises:
        ConfigError: An unknown name, or more numbers than a frame holds.
    """

    senses: tuple[str, ...]
    n_segments: int
    n_muscles: int
    timestep_us: int

    def __post_init__(self) -> None:
        """Checks the names and numbers."""
        for name in self.senses:
            if name not in SENSED:
                raise ConfigError(f"nothing called {name!r} can be sensed; {suggest(name, SENSED)}")
        most = max(self.n_sensed, self.n_muscles)
        if most > MOST_NUMBERS:
            raise ConfigError(f"a frame holds {MOST_NUMBERS} numbers, not the {most} of this worm")

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shape of everything that is sensed, by name."""
        return {name: SENSED[name].shape(self.n_segments) for name in self.senses}

    @property
    def n_sensed(self) -> int:
        """Numbers in a frame of sensation."""
        return sum(int(np.prod(shape)) for shape in self.shapes.values())

    @property
    def most_bytes(self) -> int:
        """Bytes of the longest frame, a hello or one of numbers, before they are stuffed."""
        return _LEAST + max(_HELLO.size, 4 * self.n_sensed, 4 * self.n_muscles)

    @property
    def digest(self) -> int:
        """CRC-32 of the interface in words, so that neither side takes one number for another."""
        sensed = " ".join(f"{name}{list(shape)}" for name, shape in self.shapes.items())
        text = f"wire {VERSION}: {sensed} -> activation[{self.n_muscles}] every {self.timestep_us} us"
        return zlib.crc32(text.encode())

    def split(self, values: Array) -> dict[str, Array]:
        """Returns the numbers of a frame of sensation by name."""
        result, start = {}, 0
        for name, shape in self.shapes.items():
            end = start + int(np.prod(shape))
            result[name], start = values[start:end].reshape(shape), end
        return result


@dataclass(frozen=True, slots=True)
class Hello:
    """How both sides begin; a peer answers with its own numbers, and with the host's steps and silence.

    Attributes:
        role: Who says it.
        counts: Segments, muscles and numbers sensed.
        n_steps: Control steps that each exchange stands for.
        silence_ms: After so long without a valid frame a robot relaxes by itself.
        digest: Of the interface.
    """

    role: int
    counts: Sequence[int]
    n_steps: int
    silence_ms: int
    digest: int

    @classmethod
    def of(cls, role: Role, interface: Interface, n_steps: int, silence_ms: int) -> Hello:
        """Returns the hello of a side with an interface."""
        counts = (interface.n_segments, interface.n_muscles, interface.n_sensed)
        return cls(role, counts, n_steps, silence_ms, interface.digest)

    @classmethod
    def read(cls, payload: bytes) -> Hello:
        """Reads a payload; `FrameError` where it has another length."""
        if len(payload) != _HELLO.size:
            raise FrameError("a wrong length")
        role, *counts, n_steps, silence_ms, digest = _HELLO.unpack(payload)
        return cls(role, tuple(counts), n_steps, silence_ms, digest)

    def payload(self) -> bytes:
        """Returns it as a payload."""
        return _HELLO.pack(self.role, *self.counts, self.n_steps, self.silence_ms, self.digest)

    def misfit(self, theirs: Hello, role: Role) -> str | None:
        """Returns what differs in the hello of the other side, which should have a role; None if all is well."""
        if theirs.role != role:
            return f"it has role {theirs.role}, not {int(role)} ({role.name.lower()})"
        for name, own, other in zip(("segments", "muscles", "numbers sensed"), self.counts, theirs.counts, strict=True):
            if own != other:
                return f"it has {other} {name}, not {own}"
        return None if self.digest == theirs.digest else "its sensors or its control step are others"
