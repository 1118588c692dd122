"""Packets of a bus of servos in the manner of Dynamixel: protocols 1.0 and 2.0, and the registers that are used.

Described at https://emanual.robotis.com/docs/en/dxl/protocol1 and protocol2; registers are those of the series AX and
MX, and of X540. The maker's `dynamixel-sdk` (4.1.0) is not used. Its sync read gives up all servos when one does not
answer, drops the error byte by which a servo reports an overload, and polls the port for 34 ms and more before a
time-out.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from enum import Enum
from typing import ClassVar

BROADCAST = 254
STEPS_PER_TURN = 4096
WATCHDOG_UNIT_S = 0.02
SYNC_WRITE = 0x83
_MOST_BYTES = 2048


class Register(Enum):
    """What is read and written."""

    TORQUE = "torque"
    MODE = "mode"  # of protocol 1.0 the limits of the angle: none in wheel mode
    WATCHDOG = "watchdog"
    GOAL = "goal"
    SPEED = "speed"
    MOST_SPEED = "most speed"
    SENSED = "sensed"  # a potentiometer on the first external port, of protocol 1.0 the position


def _shifted(crc: int) -> int:
    for _ in range(8):
        crc = (crc << 1) ^ (0x18005 if crc & 0x8000 else 0)
    return crc


_CRC_OF_BYTE = [_shifted(byte << 8) for byte in range(256)]


def crc16(data: bytes) -> int:
    """Returns the checksum of a packet of protocol 2.0: CRC-16 of polynomial 0x8005, from 0, the highest bit first.

    The standard library's `binascii.crc_hqx` has another polynomial, 0x1021.
    """
    crc = 0
    for byte in data:
        crc = (crc << 8) & 0xFFFF ^ _CRC_OF_BYTE[crc >> 8 ^ byte]
    return crc


class Protocol2:
    """How packets of protocol 2.0 are written and read.

    Attributes:
        header: What a packet begins with.
        length: Where its length stands, that of what is behind.
        registers: Address and bytes of each register; what a servo has not is left out.
        wheel_mode: What `Register.MODE` is for a servo that turns without end.
        rpm_per_unit: Turns a minute in one unit of `Register.SPEED`.
        most_servos: That one packet can set.
    """

    header = b"\xff\xff\xfd\0"
    length = slice(5, 7)
    registers: ClassVar[Mapping[Register, tuple[int, int]]] = {
        Register.TORQUE: (64, 1), Register.MODE: (11, 1), Register.WATCHDOG: (98, 1), Register.GOAL: (116, 4),
        Register.SPEED: (104, 4), Register.MOST_SPEED: (44, 4), Register.SENSED: (152, 2),
    }  # fmt: skip
    wheel_mode, extended_mode = 1, 4
    most_servos = 252
    rpm_per_unit = 0.229

    def packet(self, servo: int, instruction: int, parameters: bytes = b"") -> bytes:
        """Returns a packet for the line, in whose body no other may seem to begin."""
        body = (bytes([instruction]) + parameters).replace(self.header[:3], self.header[:3] + b"\xfd")
        whole = self.header + struct.pack("<BH", servo, len(body) + 2) + body
        return whole + struct.pack("<H", crc16(whole))

    def opened(self, whole: bytes) -> tuple[int, int, bytes] | None:
        """Returns servo, instruction and parameters of a packet; None if its checksum is wrong."""
        if crc16(whole[:-2]) != int.from_bytes(whole[-2:], "little"):
            return None
        body = whole[7:-2].replace(self.header[:3] + b"\xfd", self.header[:3])
        return whole[4], body[0], body[1:]

    def questions(self, register: Register, servos: Sequence[int]) -> list[tuple[bytes, Sequence[int]]]:
        """Returns the packets that ask for a register, and which servos answer each."""
        return [(self.packet(BROADCAST, 0x82, self.place(register) + bytes(servos)), servos)]

    def answer(self, servo: int, register: Register, value: int) -> bytes:
        """Returns a servo's answer without an error."""
        return self.packet(servo, 0x55, b"\0" + self.number(register, value))

    def status(self, instruction: int, parameters: bytes) -> tuple[int, bytes] | None:
        """Returns the error and the value of an answer; None for what is no answer."""
        return (parameters[0], parameters[1:]) if instruction == 0x55 and parameters else None

    def place(self, register: Register) -> bytes:
        """Returns address and size of a register as they stand in a packet."""
        return struct.pack("<HH", *self.registers[register])

    def number(self, register: Register, value: int) -> bytes:
        """Returns a number as it stands in a register."""
        return value.to_bytes(self.registers[register][1], "little", signed=value < 0)

    def value(self, register: Register, data: bytes) -> int:
        """Returns the number that `number` has written."""
        return int.from_bytes(data, "little", signed=register in (Register.GOAL, Register.SPEED))

    def sync_write(self, register: Register, values: Mapping[int, int]) -> bytes:
        """Returns the packet that sets a register of servos."""
        data = b"".join(bytes([servo]) + self.number(register, value) for servo, value in values.items())
        return self.packet(BROADCAST, SYNC_WRITE, self.place(register) + data)


class Protocol1(Protocol2):
    """The same for protocol 1.0, whose servos have no watchdog, and are asked one by one."""

    header = b"\xff\xff"
    length = slice(3, 4)
    registers: ClassVar[Mapping[Register, tuple[int, int]]] = {
        Register.TORQUE: (24, 1), Register.MODE: (6, 4), Register.GOAL: (30, 2), Register.SPEED: (32, 2),
        Register.SENSED: (36, 2),
    }  # fmt: skip
    wheel_mode = 0
    most_servos = 50  # the length of a packet is one byte, and a mode has four
    rpm_per_unit = 0.111
    backward = 0x400

    def packet(self, servo: int, instruction: int, parameters: bytes = b"") -> bytes:
        """Has a length of one byte, and the sum of all as a check."""
        body = bytes([servo, len(parameters) + 2, instruction]) + parameters
        return self.header + body + bytes([~sum(body) & 0xFF])

    def opened(self, whole: bytes) -> tuple[int, int, bytes] | None:
        """In an answer the error stands where the instruction would."""
        return (whole[2], whole[4], whole[5:-1]) if ~sum(whole[2:-1]) & 0xFF == whole[-1] else None

    def questions(self, register: Register, servos: Sequence[int]) -> list[tuple[bytes, Sequence[int]]]:
        """Asks each with a packet of its own."""
        return [(self.packet(servo, 0x02, self.place(register)), [servo]) for servo in servos]

    def answer(self, servo: int, register: Register, value: int) -> bytes:
        """Has its error, none, in place of an instruction."""
        return self.packet(servo, 0, self.number(register, value))

    def status(self, instruction: int, parameters: bytes) -> tuple[int, bytes] | None:
        """Reads `answer`."""
        return instruction, parameters

    def place(self, register: Register) -> bytes:
        """Has one byte for either."""
        return bytes(self.registers[register])

    def number(self, register: Register, value: int) -> bytes:
        """A speed has its direction in a bit of its own."""
        return super().number(register, -value | self.backward if value < 0 else value)

    def value(self, register: Register, data: bytes) -> int:
        """Reads `number`."""
        number = int.from_bytes(data, "little")
        return self.backward - number if register is Register.SPEED and number & self.backward else number


PROTOCOLS: Mapping[int, Protocol2] = {1: Protocol1(), 2: Protocol2()}


class PacketDecoder:
    """Finds packets in what comes over the bus; holds no more than one.

    Attributes:
        rejected: How many were not valid, by what was wrong.
    """

    def __init__(self, protocol: Protocol2) -> None:
        """Begins with nothing."""
        self.rejected: Counter[str] = Counter()
        self._protocol, self._held = protocol, bytearray()

    def feed(self, data: bytes) -> Iterator[tuple[int, int, bytes]]:
        """Yields servo, instruction and parameters of the valid packets that end in these bytes."""
        header, length_at = self._protocol.header, self._protocol.length
        self._held += data
        while (start := self._held.find(header)) >= 0:
            del self._held[:start]
            if len(self._held) < length_at.stop:
                return
            length = int.from_bytes(self._held[length_at], "little")
            whole = bytes(self._held[: length_at.stop + length])
            if not length_at.stop - length_at.start < length <= _MOST_BYTES:
                self._skip("a wrong length")
            elif len(whole) < length_at.stop + length:
                # What a lost piece swallows ends at the next packet.
                if (following := self._held.find(header, len(header))) < 0:
                    return
                self.rejected["a part missing"] += 1
                del self._held[:following]
            elif (opened := self._protocol.opened(whole)) is None:
                self._skip("a wrong checksum")
            else:
                del self._held[: len(whole)]
                yield opened
        del self._held[:-3]

    def _skip(self, reason: str) -> None:
        self.rejected[reason] += 1
        del self._held[:1]
