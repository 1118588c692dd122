"""The state of a whole simulation as bytes, and the two slots of a run file that carry it.

The slots are written in turn. Each carries a sequence number and a checksum, so that a slot torn by a kill is
noticed and the other one, at most one checkpoint older, is used.
"""

from __future__ import annotations

import io
import struct
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from annelid.protocols import Sensation, State

_HEADER = struct.Struct("<qqI")  # sequence number, length of the payload, CRC-32 of both and the payload
_NUMBERS = struct.Struct("<qq")
_WORD = 1 << 64


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """All that the next control step depends on."""

    step: int  # control steps taken since time zero
    sensation: Sensation  # the plant's latest, without noise
    noise: NDArray[np.uint64]  # state of the generator of the sensor noise, as `generator_state` gives it
    plant: State
    controller: State

    def to_bytes(self) -> bytes:
        """Packs it as an uncompressed npz archive."""
        buffer = io.BytesIO()
        np.savez(buffer, **self.arrays())
        return buffer.getvalue()

    def arrays(self) -> dict[str, Any]:
        """Returns all that it consists of, by name."""
        arrays: dict[str, Any] = {"loop/step": np.int64(self.step), "loop/noise": self.noise}
        arrays |= {f"sensation/{field.name}": getattr(self.sensation, field.name) for field in fields(Sensation)}
        arrays |= {f"plant/{name}": value for name, value in self.plant.items()}
        return arrays | {f"controller/{name}": value for name, value in self.controller.items()}

    def misfit(self, fresh: Checkpoint, timestep_s: float, last_step: int) -> str | None:
        """Returns why plant and controller cannot be in this state, or None where they can.

        Given are their checkpoint at time zero, the control step, and how many of these the whole run has.
        """
        if not 0 <= self.step <= last_step:
            return f"its step is {self.step}, not in 0 .. {last_step}"
        ours, theirs = self.arrays(), fresh.arrays()
        for name in sorted({*ours, *theirs}):
            if name not in ours or name not in theirs:
                found = "missing" if name in theirs else "not of this plant or controller"
                reason = "another version of annelid, of its plant or its controller wrote it"
                return f"{reason} ({name!r} is {found}); run it anew"
            own, wanted = np.asarray(ours[name]), np.asarray(theirs[name])
            if own.shape != wanted.shape or own.dtype.kind != wanted.dtype.kind:
                return f"{name!r} is {own.dtype} of shape {own.shape}, not {wanted.dtype} of shape {wanted.shape}"
            # A quantity that a body does not have is NaN from the start.
            if own.dtype.kind == "f" and np.isfinite(wanted).all() and not np.isfinite(own).all():
                return f"{name!r} holds a value that is not finite"
            counts = own.dtype.kind == "i" and name.endswith(("step", "steps"))
            if counts and not np.all((own >= 0) & (own <= self.step)):
                return f"{name!r} is {own.tolist()}, not in 0 .. {self.step}"
        if abs(self.sensation.time_s - self.step * timestep_s) > timestep_s / 2:
            return f"its time is {self.sensation.time_s:g} s, not the {self.step * timestep_s:g} s of its step"
        return None

    @classmethod
    def from_bytes(cls, packed: bytes) -> Checkpoint:
        """Unpacks what `to_bytes` gave; ValueError or KeyError where they are no such bytes or declare more."""
        groups: dict[str, dict[str, NDArray[Any]]] = {"loop": {}, "sensation": {}, "plant": {}, "controller": {}}
        with zipfile.ZipFile(io.BytesIO(packed)) as archive:
            entries = archive.infolist()
            # A little file may unpack to a large one, and entries may be the same bytes under many names.
            stored = all(entry.compress_type == zipfile.ZIP_STORED for entry in entries)
            if not stored or sum(entry.file_size for entry in entries) > len(packed):
                raise ValueError("its checkpoint declares more than it holds")
        for key, array in np.load(io.BytesIO(packed), allow_pickle=False).items():
            group, _, name = key.partition("/")
            groups[group][name] = array
        sensed, loop = groups["sensation"], groups["loop"]
        sensation = Sensation(time_s=float(sensed.pop("time_s")), **sensed)
        return cls(int(loop["step"]), sensation, loop["noise"], groups["plant"], groups["controller"])


def to_slot(sequence: int, payload: bytes) -> bytes:
    """Returns a slot's content: header, then payload."""
    return _HEADER.pack(sequence, len(payload), _checksum(sequence, payload)) + payload


def _checksum(sequence: int, payload: bytes) -> int:
    return zlib.crc32(payload, zlib.crc32(_NUMBERS.pack(sequence, len(payload))))


def newest_payload(slots: Sequence[bytes]) -> bytes | None:
    """Returns the payload of the intact slot with the highest sequence number, or None if none is intact."""
    intact: dict[int, bytes] = {}
    for slot in slots:
        if len(slot) < _HEADER.size:
            continue
        sequence, length, checksum = _HEADER.unpack_from(slot)
        payload = slot[_HEADER.size : _HEADER.size + max(length, 0)]
        # Sequence numbers count from 1: a slot of zeros was never written.
        if sequence > 0 and len(payload) == length and _checksum(sequence, payload) == checksum:
            intact[sequence] = payload
    return intact[max(intact)] if intact else None


def slot_capacity(payload: bytes) -> int:
    """Returns the room in bytes for the slots of a run whose first checkpoint is ``payload``.

    Shapes and dtypes of a state never change, so all checkpoints are equally long, but for a margin.
    """
    return _HEADER.size + len(payload) + len(payload) // 16 + 4096


def generator_state(generator: np.random.Generator) -> NDArray[np.uint64]:
    """Returns the state of a PCG64 generator as six 64-bit words, shape ``(6,)``."""
    state: Any = generator.bit_generator.state
    numbers = state["state"]["state"], state["state"]["inc"]
    words = [word for number in numbers for word in divmod(number, _WORD)]
    return np.array([*words, state["has_uint32"], state["uinteger"]], dtype=np.uint64)


def restore_generator(words: NDArray[np.uint64]) -> np.random.Generator:
    """Returns a PCG64 generator in the state that `generator_state` gave; ValueError where none has such a state."""
    if words.shape != (6,) or words.dtype != np.uint64 or not words[3] & 1 or words[4] > 1 or words[5] >> 32:
        raise ValueError("no generator of noise has the state that it holds")
    high, low, inc_high, inc_low, has_uint32, uinteger = words.tolist()
    numbers = {"state": high * _WORD + low, "inc": inc_high * _WORD + inc_low}
    state: Any = {"bit_generator": "PCG64", "state": numbers, "has_uint32": has_uint32, "uinteger": uinteger}
    bits = np.random.PCG64()
    bits.state = state
    return np.random.Generator(bits)
