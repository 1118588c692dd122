"""A simulated robot of servos: a line that answers as their bus would, each segment a model with a lag."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

import numpy as np

from annelid_lab.loop.links import MOST_READ
from annelid_lab.loop.servos import BROADCAST, WATCHDOG_UNIT_S, Instruction, PacketDecoder, Register, Wiring, packet

_SIZES = {
    Register.TORQUE: 1,
    Register.WATCHDOG: 1,
    Register.GOAL: 4,
    Register.POSITION: 4,
    Register.POTENTIOMETER: 2,
}
_DATA_RANGE_ERROR, _ACCESS_ERROR = 0x04, 0x07


class PseudoRobot:
    """Servos 1 .. n, which follow their goals with a lag, and the potentiometers of the segments that they contract.

    A contracted segment is longer by ``reach_m``. A potentiometer reads whole counts of 12 bits with normal noise. It
    is a `Link`: what the loop sends reaches the servos at once, and what they answer comes after a latency.

    Attributes:
        name: For sentences.
        position: Of every servo, in its steps, ``(n_muscles,)``.
    """

    name = "the pseudo-robot"

    def __init__(
        self,
        n_segments: int,
        n_muscles: int,
        *,
        reach_m: float = 0.06,
        lag_s: float = 0.15,
        noise_m: float = 0.0005,
        latency_s: float = 0.001,
        seed: int = 0,
        wiring: Wiring | None = None,
        clock: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Makes a relaxed robot.

        Args:
            n_segments: Segments.
            n_muscles: Servos, one or two per segment.
            reach_m: Lengthening of a segment that is contracted fully, m.
            lag_s: Time constant of a servo with its segment, s.
            noise_m: Standard deviation of a potentiometer's noise, m.
            latency_s: Time from a packet to its answer, s.
            seed: Of the noise.
            wiring: Positions and counts.
            clock: Time that never goes back, s.
            sleep: Waits so many seconds.
        """
        self.wiring = wiring or Wiring()
        self._n_segments, self._n = n_segments, n_muscles
        self._reach_m, self._lag_s, self._noise_m, self._latency_s = reach_m, lag_s, noise_m, latency_s
        self._rng = np.random.default_rng(seed)
        self._decoder = PacketDecoder()
        self._clock, self._sleep = clock, sleep
        self._now_s = self._last_packet_s = clock()
        self._answers: deque[tuple[float, bytes]] = deque(maxlen=1024)
        self.position = np.full(n_muscles, float(self.wiring.relaxed))
        self._table = {register: np.zeros(n_muscles, dtype=np.int64) for register in _SIZES}
        self._table[Register.GOAL][:] = self.wiring.relaxed
        self._watchdog_ended = np.zeros(n_muscles, dtype=bool)

    @property
    def contraction(self) -> np.ndarray:
        """How far each servo is from relaxed, 0, to contracted, 1."""
        return (self.position - self.wiring.relaxed) / (self.wiring.contracted - self.wiring.relaxed)

    def send(self, data: bytes) -> None:
        """Takes bytes from the bus, as `Link.send`."""
        self._move()
        for servo, instruction, parameters in self._decoder.feed(data):
            if instruction != Instruction.STATUS:
                self._last_packet_s = self._now_s
                self._execute(servo, instruction, parameters)

    def receive(self, timeout_s: float) -> bytes:
        """Returns what the servos have answered by now, as `Link.receive`."""
        until = self._clock() + max(timeout_s, 0.0)
        while True:
            self._move()
            if self._answers and self._answers[0][0] <= self._now_s:
                due = b""
                while self._answers and self._answers[0][0] <= self._now_s and len(due) < MOST_READ // 2:
                    due += self._answers.popleft()[1]
                return due
            if self._now_s >= until:
                return b""
            next_s = min(self._answers[0][0], until) if self._answers else until
            self._sleep(next_s - self._now_s)

    def close(self) -> None:
        """Does nothing: there is no line to close."""

    def _move(self) -> None:
        """Brings the servos up to the present."""
        now_s = self._clock()
        time_s, self._now_s = now_s - self._now_s, now_s
        patience_s = WATCHDOG_UNIT_S * self._table[Register.WATCHDOG]
        self._watchdog_ended |= (patience_s > 0) & (now_s - self._last_packet_s > patience_s)
        # A servo whose watchdog has ended the session stays where it is, and takes no goal until that is written as 0.
        moves = (self._table[Register.TORQUE] == 1) & ~self._watchdog_ended
        share = -np.expm1(-time_s / self._lag_s)
        self.position += np.where(moves, share * (self._table[Register.GOAL] - self.position), 0.0)

    def _execute(self, servo: int, instruction: int, parameters: bytes) -> None:
        mine = range(1, self._n + 1)
        head, rest = parameters[:4], parameters[4:]
        address, size = int.from_bytes(head[:2], "little"), int.from_bytes(head[2:], "little")
        match instruction:
            case Instruction.PING:
                for each in mine if servo == BROADCAST else {servo} & set(mine):
                    self._answer(each, 0, b"\x60\x04\x2d")
            case Instruction.READ if servo in mine and len(parameters) == 4:
                self._read(servo, address, size)
            case Instruction.SYNC_READ if servo == BROADCAST:
                for each in rest:
                    if each in mine:
                        self._read(each, address, size)
            case Instruction.WRITE if servo in mine and len(parameters) > 2:
                self._answer(servo, self._write(servo, address, parameters[2:]), b"")
            case Instruction.SYNC_WRITE if servo == BROADCAST and size > 0:
                for start in range(0, len(rest) - size, size + 1):
                    if rest[start] in mine:
                        self._write(rest[start], address, rest[start + 1 : start + 1 + size])

    def _read(self, servo: int, address: int, size: int) -> None:
        if _SIZES.get(address) != size:  # type: ignore[call-overload]
            self._answer(servo, _ACCESS_ERROR, b"")
            return
        register = Register(address)
        value = int(self._table[register][servo - 1])
        if register == Register.POSITION:
            value = round(self.position[servo - 1])
        elif register == Register.POTENTIOMETER:
            of_segment = self.contraction.reshape(self._n_segments, -1).mean(axis=1)
            segment = (servo - 1) // (self._n // self._n_segments)
            length_m = self._reach_m * of_segment[segment] + self._rng.normal(0.0, self._noise_m)
            value = min(max(round(self.wiring.rest_counts + length_m / self.wiring.m_per_count), 0), 4095)
        self._answer(servo, 0, value.to_bytes(size, "little"))

    def _write(self, servo: int, address: int, data: bytes) -> int:
        """Writes a register; returns the number of the error."""
        if _SIZES.get(address) != len(data) or address >= Register.POSITION:  # type: ignore[call-overload]
            return _ACCESS_ERROR
        value = int.from_bytes(data, "little")
        if value > (4095 if address == Register.GOAL else 127):
            return _DATA_RANGE_ERROR
        if address == Register.WATCHDOG and value == 0:
            self._watchdog_ended[servo - 1] = False
        elif address == Register.GOAL and self._watchdog_ended[servo - 1]:
            return _DATA_RANGE_ERROR
        self._table[Register(address)][servo - 1] = value
        return 0

    def _answer(self, servo: int, error: int, data: bytes) -> None:
        status = packet(servo, Instruction.STATUS, bytes([error]) + data)
        self._answers.append((self._now_s + self._latency_s, status))
