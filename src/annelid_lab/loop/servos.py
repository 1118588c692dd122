"""A robot of position servos on a bus in the manner of Dynamixel's protocol 2.0, a string potentiometer at each.

The protocol and the registers (those of the X540 series) are described at https://emanual.robotis.com/docs/en/dxl/protocol2.
The maker's `dynamixel-sdk` (4.1.0) is not used. Its sync read gives up all servos when one does not answer, drops the
error byte by which a servo reports an overload, and polls the port for 34 ms and more before a time-out.
"""

from __future__ import annotations

import math
import struct
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from annelid.errors import ConfigError, SimulationStopped
from annelid.protocols import Array
from annelid_lab.loop.links import Link
from annelid_lab.loop.remote import PacedPlant
from annelid_lab.loop.session import ANSWER, STOP_TRIES, STOP_WAIT_S, Limits, Pace, Partner

HEADER = b"\xff\xff\xfd"
BROADCAST = 254
MOST_SERVOS = 252
_MOST_BYTES = 2048
WATCHDOG_UNIT_S = 0.02


class Instruction(IntEnum):
    """What a packet asks for, or that it is an answer."""

    STATUS = 0x55
    SYNC_READ = 0x82
    SYNC_WRITE = 0x83


class Register(IntEnum):
    """Addresses in a servo's table."""

    TORQUE = 64
    WATCHDOG = 98
    GOAL = 116
    POTENTIOMETER = 152


def _shifted(crc: int) -> int:
    for _ in range(8):
        crc = (crc << 1) ^ (0x18005 if crc & 0x8000 else 0)
    return crc


_CRC_OF_BYTE = [_shifted(byte << 8) for byte in range(256)]


def crc16(data: bytes) -> int:
    """Returns the checksum of a packet: CRC-16 of polynomial 0x8005, from 0, the highest bit first.

    The standard library's `binascii.crc_hqx` has another polynomial, 0x1021.
    """
    crc = 0
    for byte in data:
        crc = (crc << 8) & 0xFFFF ^ _CRC_OF_BYTE[crc >> 8 ^ byte]
    return crc


def packet(servo: int, instruction: int, parameters: bytes = b"") -> bytes:
    """Returns a packet for the line."""
    body = (bytes([instruction]) + parameters).replace(HEADER, HEADER + b"\xfd")
    head = HEADER + b"\0" + struct.pack("<BH", servo, len(body) + 2)
    return head + body + struct.pack("<H", crc16(head + body))


@dataclass(slots=True)
class PacketDecoder:
    """Finds packets in what comes over the bus; holds no more than one.

    Attributes:
        rejected: How many were not valid, by what was wrong.
    """

    rejected: Counter[str] = field(default_factory=Counter)
    _held: bytearray = field(default_factory=bytearray)

    def feed(self, data: bytes) -> Iterator[tuple[int, int, bytes]]:
        """Yields servo, instruction and parameters of the valid packets that end in these bytes."""
        self._held += data
        while (start := self._held.find(HEADER + b"\0")) >= 0:
            del self._held[:start]
            if len(self._held) < 7:
                return
            length = int.from_bytes(self._held[5:7], "little")
            if not 3 <= length <= _MOST_BYTES:
                self._skip("a wrong length")
                continue
            if len(self._held) < 7 + length:
                # What a lost piece swallows ends at the next packet.
                if (following := self._held.find(HEADER + b"\0", 4)) >= 0:
                    self.rejected["a part missing"] += 1
                    del self._held[:following]
                    continue
                return
            whole = bytes(self._held[: 7 + length])
            if crc16(whole[:-2]) != int.from_bytes(whole[-2:], "little"):
                self._skip("a wrong checksum")
                continue
            del self._held[: len(whole)]
            body = whole[7:-2].replace(HEADER + b"\xfd", HEADER)
            yield whole[4], body[0], body[1:]
        del self._held[:-3]

    def _skip(self, reason: str) -> None:
        self.rejected[reason] += 1
        del self._held[:4]


@dataclass(frozen=True, slots=True)
class Wiring:
    """How a robot of servos is wired: servo k pulls muscle k, counted from 1.

    Attributes:
        relaxed: Position at activation 0, in the servo's steps.
        contracted: Position at activation 1.
        rest_counts: What a potentiometer reads at rest.
        m_per_count: Length of the segment per count, m.

    Raises:
        ConfigError: Equal positions, or a length that is zero.
    """

    relaxed: int = 1024
    contracted: int = 3072
    rest_counts: float = 512.0
    m_per_count: float = 0.3 / 4095

    def __post_init__(self) -> None:
        """Checks the numbers."""
        for name, position in (("relaxed", self.relaxed), ("contracted", self.contracted)):
            if not 0 <= position <= 4095:
                raise ConfigError(f"{name} must be a position of 0 .. 4095, not {position}")
        if self.relaxed == self.contracted or self.m_per_count == 0:
            raise ConfigError("relaxed and contracted must differ, and m_per_count must not be 0")

    def goals(self, activation: Array) -> list[int]:
        """Returns the positions for activations."""
        return np.rint(self.relaxed + activation * (self.contracted - self.relaxed)).astype(int).tolist()


class ServoPlant(PacedPlant):
    """A robot of servos and potentiometers, to the loop like any body."""

    def __init__(
        self,
        link: Link,
        pace: Pace,
        limits: Limits,
        rest_m: Array,
        n_muscles: int,
        timestep_s: float,
        watchdog: int,
        wiring: Wiring,
    ) -> None:
        """Makes a robot at rest, as `PacedPlant`.

        Raises:
            ConfigError: More muscles than a bus has addresses.
        """
        if n_muscles > MOST_SERVOS:
            raise ConfigError(f"a bus has {MOST_SERVOS} servos at most, not {n_muscles}")
        super().__init__(Partner("robot", link, pace, watchdog), pace, limits, rest_m, n_muscles, timestep_s)
        self._link, self._wiring, self._decoder = link, wiring, PacketDecoder()
        self._ids = range(1, n_muscles + 1)
        self._is_open = False

    def _begin(self) -> None:
        silence = min(max(math.ceil(self.partner.watchdog * self._pace.period_s / WATCHDOG_UNIT_S), 1), 127)
        relaxed = self._wiring.goals(np.zeros(self.n_muscles))
        end = self._pace.clock() + 2.0
        missing: set[int] = set(self._ids)
        while missing and self._pace.clock() < end:
            try:
                # A watchdog that has ended a session takes no goal until it is set to 0.
                self._write(Register.WATCHDOG, 1, [0] * self.n_muscles)
                self._write(Register.GOAL, 4, relaxed)
                self._write(Register.TORQUE, 1, [1] * self.n_muscles)
                self._write(Register.WATCHDOG, 1, [silence] * self.n_muscles)
                missing = set(self._ids) - self._read(Register.POTENTIOMETER, 0.2).keys()
            except OSError as error:
                raise ConfigError(f"the line to the robot at {self._link.name} is gone: {error}") from None
        if missing:
            names = ", ".join(map(str, sorted(missing)[:10]))
            raise ConfigError(
                f"servos {names} do not answer at {self._link.name}: {self.partner.what_came()}; the worm has "
                f"{self.n_muscles} muscles, so servos 1 .. {self.n_muscles} must be there"
            )
        self._is_open = True

    def _transfer(self, command: Array) -> dict[str, Array] | None:
        if not self._is_open:
            raise SimulationStopped("the robot has been stopped")
        began = self._pace.clock()
        try:
            # Answers carry no number: what came late must not pass for an answer to this.
            while late := self._link.receive(0.0):
                for _ in self._decoder.feed(late):
                    self.partner.wrong("an answer that is late or twice")
                if self._pace.clock() > began + ANSWER * self._pace.period_s:
                    break
            self._write(Register.GOAL, 4, self._wiring.goals(command))
            counts = self._read(Register.POTENTIOMETER, ANSWER * self._pace.period_s)
        except OSError as error:
            raise self.partner.line_lost(error) from None
        is_whole = len(counts) == self.n_muscles
        self.partner.answered(self._pace.clock() - began if is_whole else None)
        if not is_whole:
            return None
        read = np.array([counts[servo] for servo in self._ids], dtype=np.float64) - self._wiring.rest_counts
        return {"lengthening_m": self._wiring.m_per_count * read.reshape(self.n_segments, -1).mean(axis=1)}

    def _relax(self) -> str | None:
        if not self._is_open:
            return None
        self._is_open = False
        error: object = ""
        for _ in range(STOP_TRIES):
            try:
                # Without its watchdog, which would hold a servo on its way to where it is relaxed.
                self._write(Register.WATCHDOG, 1, [0] * self.n_muscles)
                self._write(Register.GOAL, 4, self._wiring.goals(self.command))
                if len(self._read(Register.GOAL, STOP_WAIT_S, 4)) == self.n_muscles:
                    return None
            except (OSError, SimulationStopped) as reason:
                error = f": {reason}"
        return f"the robot at {self._link.name} did not confirm that it stopped{error}"

    def _write(self, register: Register, size: int, values: list[int]) -> None:
        written = zip(self._ids, values, strict=True)
        data = b"".join(bytes([servo]) + value.to_bytes(size, "little", signed=size > 1) for servo, value in written)
        self._link.send(packet(BROADCAST, Instruction.SYNC_WRITE, struct.pack("<HH", register, size) + data))

    def _read(self, register: Register, wait_s: float, size: int = 2) -> Mapping[int, int]:
        """Reads a number of every servo; those that do not answer in time are left out."""
        asked = struct.pack("<HH", register, size) + bytes(self._ids)
        until = self._pace.clock() + wait_s
        self._link.send(packet(BROADCAST, Instruction.SYNC_READ, asked))
        found: dict[int, int] = {}
        while len(found) < self.n_muscles and (left := until - self._pace.clock()) > 0:
            for servo, instruction, parameters in self._decoder.feed(self._link.receive(left)):
                if instruction != Instruction.STATUS or servo not in self._ids or len(parameters) != 1 + size:
                    self.partner.wrong("a packet that is no answer")
                elif parameters[0]:
                    raise SimulationStopped(
                        f"servo {servo} at {self._link.name} reports error {parameters[0]:#04x} (bit 7: overload, "
                        "overheating or wrong voltage)"
                    )
                else:
                    found[servo] = int.from_bytes(parameters[1:], "little")
            self.partner.rejected(self._decoder.rejected, "packet")
        return found
