"""A simulated robot of servos: a line that answers as their bus would, each segment a model with a lag."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

import numpy as np

from annelid_lab.loop.dynamixel import PROTOCOLS, SYNC_WRITE, WATCHDOG_UNIT_S, PacketDecoder, Register
from annelid_lab.loop.links import MOST_READ
from annelid_lab.loop.servos import MOST_SPEED, Wiring

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
        given_way: What its cable adds to the speed of every wheel that turns, in steps a second, ``(n_muscles,)``.
    """

    name = "the pseudo-robot"

    def __init__(
        self,
        n_segments: int,
        n_muscles: int,
        *,
        lag_s: float = 0.15,
        noise_m: float = 0.0005,
        latency_s: float = LATENCY_S,
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
            latency_s: Time from a packet to its answer, s.
            wiring: Positions and counts, protocol and mode.
            clock: Time that never goes back, s.
            sleep: Waits so many seconds.
        """
        self.wiring = wiring or Wiring()
        self._n_segments, self._servos = n_segments, range(1, n_muscles + 1)
        self._lag_s, self._noise_m, self._rng = lag_s, noise_m, np.random.default_rng(0)
        self._bus = PROTOCOLS[self.wiring.protocol]
        self._decoder, self._latency_s = PacketDecoder(self._bus), latency_s
        self._clock, self._sleep = clock, sleep
        self._now_s = self._last_packet_s = clock()
        self._answers: deque[tuple[float, bytes]] = deque(maxlen=1024)
        self.position = np.full(n_muscles, float(self.wiring.relaxed))
        self.given_way = np.zeros(n_muscles)
        self._table = {register: np.zeros(n_muscles, dtype=np.int64) for register in Register}
        self._table[Register.GOAL][:] = self.wiring.relaxed
        self._table[Register.MOST_SPEED][:] = MOST_SPEED
        self._table[Register.MODE][:] = 3  # position control; of protocol 1.0 any limit of the angle
        self._watchdog_ended = np.zeros(n_muscles, dtype=bool)

    @property
    def contraction(self) -> np.ndarray:
        """How far each servo is from relaxed, 0, to contracted, 1."""
        return (self.position - self.wiring.relaxed) / (self.wiring.contracted - self.wiring.relaxed)

    def send(self, data: bytes) -> None:
        """Takes bytes from the bus, as `Link.send`."""
        self._move()
        for servo, instruction, parameters in self._decoder.feed(data):
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
        if self.wiring.is_wheel:
            speed = self._table[Register.SPEED]
            moved = time_s * (self.wiring.steps_per_s * speed + np.where(speed, self.given_way, 0.0))
        else:
            moved = -np.expm1(-time_s / self._lag_s) * (self._table[Register.GOAL] - self.position)
        self.position += np.where(moves, moved, 0.0)

    def _execute(self, servo: int, instruction: int, parameters: bytes) -> None:
        """Reads or writes one register of several servos, which is all that the loop asks for."""
        start = len(self._bus.place(Register.GOAL))
        register = next(one for one in self._bus.registers if self._bus.place(one) == parameters[:start])
        size, rest = self._bus.registers[register][1], parameters[start:]
        if instruction == SYNC_WRITE:
            for place in range(0, len(rest), size + 1):
                if rest[place] in self._servos:
                    self._write(rest[place] - 1, register, rest[place + 1 : place + 1 + size])
            return
        for asked in filter(self._servos.__contains__, rest or [servo]):
            value = int(self._table[register][asked - 1])
            if register is Register.SENSED:
                value = self._counts((asked - 1) // (len(self._servos) // self._n_segments))
            self._answers.append((self._now_s + self._latency_s, self._bus.answer(asked, register, value)))

    def _counts(self, segment: int) -> int:
        """Reads the potentiometer of a segment."""
        of_segment = self.contraction.reshape(self._n_segments, -1).mean(axis=1)
        length_m = REACH_M * of_segment[segment] + self._rng.normal(0.0, self._noise_m)
        return min(max(round(self.wiring.rest_counts + length_m / self.wiring.m_per_count), 0), 4095)

    def _write(self, place: int, register: Register, data: bytes) -> None:
        value = self._bus.value(register, data)
        if register == Register.WATCHDOG and value == 0:
            self._watchdog_ended[place] = False
        elif register == Register.GOAL and self._watchdog_ended[place]:
            return
        self._table[register][place] = value
