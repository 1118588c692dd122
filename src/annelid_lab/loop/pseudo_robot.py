"""A simulated robot of servos: a line that answers as their bus would, each segment a model with a lag."""

from __future__ import annotations

import struct
import time
from collections import deque
from collections.abc import Callable

import numpy as np

from annelid_lab.loop.links import MOST_READ
from annelid_lab.loop.servos import WATCHDOG_UNIT_S, Instruction, PacketDecoder, Register, Wiring, packet

REACH_M = 0.06
"""Lengthening of a segment that is contracted fully."""
LATENCY_S = 0.001
"""Time from a packet to its answer."""


class PseudoRobot:
    """Servos 1 .. n, which follow their goals with a lag, and the potentiometers of the segments that they contract.

    A contracted segment is longer by `REACH_M`. A potentiometer reads whole counts of 12 bits with normal noise. It
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
        lag_s: float = 0.15,
        noise_m: float = 0.0005,
        wiring: Wiring | None = None,
        clock: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Makes a relaxed robot.

        Args:
            n_segments: Segments.
            n_muscles: Servos, one or two per segment.
            lag_s: Time constant of a servo with its segment, s.
            noise_m: Standard deviation of a potentiometer's noise, m.
            wiring: Positions and counts.
            clock: Time that never goes back, s.
            sleep: Waits so many seconds.
        """
        self.wiring = wiring or Wiring()
        self._n_segments, self._servos = n_segments, range(1, n_muscles + 1)
        self._lag_s, self._noise_m, self._rng = lag_s, noise_m, np.random.default_rng(0)
        self._decoder = PacketDecoder()
        self._clock, self._sleep = clock, sleep
        self._now_s = self._last_packet_s = clock()
        self._answers: deque[tuple[float, bytes]] = deque(maxlen=1024)
        self.position = np.full(n_muscles, float(self.wiring.relaxed))
        self._table = {register: np.zeros(n_muscles, dtype=np.int64) for register in Register}
        self._table[Register.GOAL][:] = self.wiring.relaxed
        self._watchdog_ended = np.zeros(n_muscles, dtype=bool)

    @property
    def contraction(self) -> np.ndarray:
        """How far each servo is from relaxed, 0, to contracted, 1."""
        return (self.position - self.wiring.relaxed) / (self.wiring.contracted - self.wiring.relaxed)

    def send(self, data: bytes) -> None:
        """Takes bytes from the bus, as `Link.send`."""
        self._move()
        for _, instruction, parameters in self._decoder.feed(data):
            self._last_packet_s = self._now_s
            self._execute(instruction, parameters)

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

    def _execute(self, instruction: int, parameters: bytes) -> None:
        """Reads or writes one register of several servos, which is all that the loop asks for."""
        address, size = struct.unpack_from("<HH", parameters)
        register, rest = Register(address), parameters[4:]
        if instruction == Instruction.SYNC_READ:
            for servo in filter(self._servos.__contains__, rest):
                value = int(self._table[register][servo - 1])
                if register == Register.POTENTIOMETER:
                    value = self._counts((servo - 1) // (len(self._servos) // self._n_segments))
                status = packet(servo, Instruction.STATUS, b"\0" + value.to_bytes(size, "little"))
                self._answers.append((self._now_s + LATENCY_S, status))
            return
        for start in range(0, len(rest), size + 1):
            if rest[start] in self._servos:
                self._write(rest[start] - 1, register, int.from_bytes(rest[start + 1 : start + 1 + size], "little"))

    def _counts(self, segment: int) -> int:
        """Reads the potentiometer of a segment."""
        of_segment = self.contraction.reshape(self._n_segments, -1).mean(axis=1)
        length_m = REACH_M * of_segment[segment] + self._rng.normal(0.0, self._noise_m)
        return min(max(round(self.wiring.rest_counts + length_m / self.wiring.m_per_count), 0), 4095)

    def _write(self, place: int, register: Register, value: int) -> None:
        if register == Register.WATCHDOG and value == 0:
            self._watchdog_ended[place] = False
        elif register == Register.GOAL and self._watchdog_ended[place]:
            return
        self._table[register][place] = value
