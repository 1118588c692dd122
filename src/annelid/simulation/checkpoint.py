"""The state of a whole simulation as bytes, and the two slots of a run file that hold it.

The slots are written in turn. Each carries a sequence number and a checksum, so that a slot torn by a kill is
noticed and the other one, at most one checkpoint older, is used.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from annelid.protocols import Sensation, State

_HEADER = struct.Struct("<qqI")  # sequence number, length of the payload, CRC-32 of both and the payload
_NUMBERS = struct.Struct("<qq")
_WORD = (1 << 64) - 1


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """All that the next control step depends on.

    Attributes:
        step: Control steps taken since time zero.
        sensation: The plant's latest sensation, without noise.
        noise: State of the generator of the sensor noise, as `generator_state` gives it.
        plant: The plant's own state.
        controller: The controller's own state.
    """

    step: int
    sensation: Sensation
    noise: NDArray[np.uint64]
    plant: State
    controller: State

    def to_bytes(self) -> bytes:
        """Packs it as an uncompressed npz archive."""
        arrays: dict[str, Any] = {
            "loop/step": np.int64(self.step),
            "loop/noise": self.noise,
        }
        arrays |= {f"sensation/{field.name}": getattr(self.sensation, field.name) for field in fields(Sensation)}
        arrays |= {f"plant/{name}": value for name, value in self.plant.items()}
        arrays |= {f"controller/{name}": value for name, value in self.controller.items()}
        buffer = io.BytesIO()
        np.savez(buffer, **arrays)
        return buffer.getvalue()

    @classmethod
    def from_bytes(cls, packed: bytes) -> Checkpoint:
        """Unpacks what `to_bytes` gave."""
        groups: dict[str, dict[str, NDArray[Any]]] = {"loop": {}, "sensation": {}, "plant": {}, "controller": {}}
        with np.load(io.BytesIO(packed), allow_pickle=False) as archive:
            for key in archive.files:
                group, _, name = key.partition("/")
                groups[group][name] = archive[key]
        time_s = float(groups["sensation"].pop("time_s"))
        return cls(
            step=int(groups["loop"]["step"]),
            sensation=Sensation(time_s=time_s, **groups["sensation"]),
            noise=groups["loop"]["noise"],
            plant=groups["plant"],
            controller=groups["controller"],
        )


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
    words: list[int] = []
    for value in (state["state"]["state"], state["state"]["inc"]):
        words += [value >> 64, value & _WORD]
    return np.array([*words, state["has_uint32"], state["uinteger"]], dtype=np.uint64)


def restore_generator(words: NDArray[np.uint64]) -> np.random.Generator:
    """Returns a PCG64 generator in the state that `generator_state` gave."""
    high, low, inc_high, inc_low, has_uint32, uinteger = (int(word) for word in words)
    bits = np.random.PCG64()
    bits.state = {
        "bit_generator": "PCG64",
        "state": {"state": high << 64 | low, "inc": inc_high << 64 | inc_low},
        "has_uint32": has_uint32,
        "uinteger": uinteger,
    }
    return np.random.Generator(bits)
