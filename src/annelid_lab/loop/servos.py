"""A robot of servos on a bus, a string potentiometer at each: positions, several turns, or wheels that wind a cable."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from annelid.errors import ConfigError, SimulationStopped
from annelid.protocols import Array
from annelid_lab.loop.dynamixel import (
    PROTOCOLS,
    STEPS_PER_TURN,
    WATCHDOG_UNIT_S,
    PacketDecoder,
    Protocol2,
    Register,
)
from annelid_lab.loop.links import Link
from annelid_lab.loop.remote import PacedPlant
from annelid_lab.loop.session import ANSWER, STOP_TRIES, STOP_WAIT_S, Limits, Pace, Partner

MOST_TURNS = 256
MOST_SPEED = 1023
"""Units of speed of a wheel."""
UNWOUND = 2.0
"""Steps from where it is relaxed within which a wheel stops."""
_LONGEST_UNWINDING_S = 10.0
_LATENCY_TIMER_S = 0.012
"""An answer that takes longer waits in a USB adapter, whose latency timer is 16 ms unless it is set."""


@dataclass(frozen=True, slots=True)
class Wiring:
    """How a robot of servos is wired: servo k pulls muscle k, counted from 1.

    Attributes:
        relaxed: Position at activation 0, in the servo's steps.
        contracted: Position at activation 1.
        rest_counts: What a potentiometer reads at rest. Servos of protocol 1.0 have none: their own position.
        m_per_count: Length of the segment per count, m.
        protocol: 1 or 2: how the bus speaks.
        is_wheel: Whether servos turn without end, at a speed. Positions then are steps of 1/4096 turn, counted by
            integrating the speeds that were sent, from relaxed at the start; by protocol 1.0 they are what is sensed.
        rpm_per_unit: Of a wheel's speed; None for what the protocol says. Servos of the series AX take a share of their
            output instead, whose unit is their speed without load over 1023: 0.0948 for an AX-18A at 12 V.

    Raises:
        ConfigError: Equal positions, one that the servos do not have, or a length that is zero.
    """

    relaxed: int = 1024
    contracted: int = 3072
    rest_counts: float = 512.0
    m_per_count: float = 0.3 / 4095
    protocol: int = 2
    is_wheel: bool = False
    rpm_per_unit: float | None = None

    def __post_init__(self) -> None:
        """Checks the numbers."""
        if self.protocol not in PROTOCOLS:
            raise ConfigError(f"protocol must be 1 or 2, not {self.protocol}")
        turns = self.protocol == 2 or self.is_wheel
        least, most = (-MOST_TURNS * STEPS_PER_TURN, MOST_TURNS * STEPS_PER_TURN) if turns else (0, STEPS_PER_TURN - 1)
        for name, position in (("relaxed", self.relaxed), ("contracted", self.contracted)):
            if not least <= position <= most:
                raise ConfigError(f"{name} must be a position of {least} .. {most}, not {position}")
        if self.relaxed == self.contracted or self.m_per_count == 0:
            raise ConfigError("relaxed and contracted must differ, and m_per_count must not be 0")
        if self.rpm_per_unit is not None and not self.rpm_per_unit > 0:
            raise ConfigError(f"rpm_per_unit must be more than 0, or None for the protocol's, not {self.rpm_per_unit}")

    @property
    def mode(self) -> int | None:
        """What is written to `Register.MODE`; None where the servos keep theirs."""
        bus = PROTOCOLS[self.protocol]
        if self.is_wheel:
            return bus.wheel_mode
        several = not all(0 <= position < STEPS_PER_TURN for position in (self.relaxed, self.contracted))
        return Protocol2.extended_mode if several else None

    @property
    def steps_per_s(self) -> float:
        """Steps a second in one unit of a wheel's speed."""
        return (self.rpm_per_unit or PROTOCOLS[self.protocol].rpm_per_unit) / 60 * STEPS_PER_TURN

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
        most = PROTOCOLS[wiring.protocol].most_servos
        if n_muscles > most:
            raise ConfigError(f"a bus of protocol {wiring.protocol} has {most} servos at most, not {n_muscles}")
        super().__init__(Partner("robot", link, pace, watchdog), pace, limits, rest_m, n_muscles, timestep_s)
        self._link, self._wiring, self._bus = link, wiring, PROTOCOLS[wiring.protocol]
        self._decoder = PacketDecoder(self._bus)
        self._ids = range(1, n_muscles + 1)
        self._wound, self._speed, self._turned_s = np.zeros(n_muscles), np.zeros(n_muscles), pace.clock()
        self._most_speed = MOST_SPEED
        self._is_open = False

    def _begin(self) -> None:
        silence = min(max(math.ceil(self.partner.watchdog * self._pace.period_s / WATCHDOG_UNIT_S), 1), 127)
        end = self._pace.clock() + 2.0
        has_limit = self._wiring.is_wheel and Register.MOST_SPEED in self._bus.registers
        missing: set[int] = set(self._ids)
        while missing and self._pace.clock() < end:
            try:
                # A watchdog that has ended a session takes no goal until it is set to 0.
                self._set(Register.WATCHDOG, 0)
                if self._wiring.mode is not None and not self._is_open:
                    self._set(Register.TORQUE, 0)
                    self._set(Register.MODE, self._wiring.mode)
                self._go(np.zeros(self.n_muscles))
                self._set(Register.TORQUE, 1)
                self._set(Register.WATCHDOG, silence)
                answers = self._read(Register.MOST_SPEED if has_limit else Register.SENSED, 0.2)
                missing = set(self._ids) - answers.keys()
                if has_limit and not missing:
                    self._most_speed = min(answers.values())
            except OSError as error:
                raise ConfigError(f"the line to the robot at {self._link.name} is gone: {error}") from None
        if missing:
            names = ", ".join(map(str, sorted(missing)[:10]))
            raise ConfigError(
                f"servos {names} do not answer at {self._link.name}: {self.partner.what_came()}; the worm has "
                f"{self.n_muscles} muscles, so servos 1 .. {self.n_muscles} must be there"
            )
        if not self._is_open:
            self._is_open = True
            self._check_latency()

    def _check_latency(self) -> None:
        """Refuses a line whose answers take longer than they may, and says why one over USB does."""
        times_s = []
        for _ in range(3):
            began = self._pace.clock()
            self._read(Register.SENSED, 0.2)
            times_s.append(self._pace.clock() - began)
        if (time_s := min(times_s)) <= ANSWER * self._pace.period_s:
            return
        usb = (
            "if it is a USB adapter, set its latency timer to 1 ms (Linux: echo 1 > "
            "/sys/bus/usb-serial/devices/ttyUSB0/latency_timer; Windows: advanced settings of the port), or "
        )
        self.stop()
        raise ConfigError(
            f"servos at {self._link.name} take {1e3 * time_s:.0f} ms to answer, longer than half a period of "
            f"{1e3 * self._pace.period_s:g} ms: {usb if time_s > _LATENCY_TIMER_S else ''}lower the rate to "
            f"{ANSWER / time_s:.0f} Hz"
        )

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
            self._go(command)
            counts = self._read(Register.SENSED, ANSWER * self._pace.period_s)
        except OSError as error:
            raise self.partner.line_lost(error) from None
        is_whole = len(counts) == self.n_muscles
        self.partner.answered(self._pace.clock() - began if is_whole else None)
        if not is_whole:
            return None
        read = np.array([counts[servo] for servo in self._ids], dtype=np.float64)
        if self._wiring.is_wheel and self._wiring.protocol == 1:
            read = self._wiring.relaxed + self._wound
        read -= self._wiring.rest_counts
        return {"lengthening_m": self._wiring.m_per_count * read.reshape(self.n_segments, -1).mean(axis=1)}

    def _relax(self) -> str | None:
        if not self._is_open:
            return None
        self._is_open = False
        error: object = ""
        for _ in range(STOP_TRIES):
            try:
                # Without its watchdog, which would hold a servo on its way to where it is relaxed.
                self._set(Register.WATCHDOG, 0)
                end = self._pace.clock() + _LONGEST_UNWINDING_S
                self._go(self.command)
                while self._wiring.is_wheel and np.abs(self._wound).max() > UNWOUND and self._pace.clock() < end:
                    self._pace.sleep(self._pace.period_s)
                    self._go(self.command)
                register = Register.SPEED if self._wiring.is_wheel else Register.GOAL
                if self._wiring.is_wheel:
                    self._set(register, 0)
                    self._speed[:] = 0.0
                if len(self._read(register, STOP_WAIT_S)) == self.n_muscles:
                    steps = float(np.abs(self._wound).max())
                    if steps <= UNWOUND:
                        return None
                    turns = steps / STEPS_PER_TURN
                    return f"wheels at {self._link.name} stopped {turns:.2g} turns from where cables are slack"
            except (OSError, SimulationStopped) as reason:
                error = f": {reason}"
        return f"the robot at {self._link.name} did not confirm that it stopped{error}"

    def _go(self, command: Array) -> None:
        """Sends positions, or the speeds at which wheels get there within a period."""
        goals = self._wiring.goals(command)
        if not self._wiring.is_wheel:
            self._write(Register.GOAL, goals)
            return
        now, unit = self._pace.clock(), self._wiring.steps_per_s
        self._wound += unit * self._speed * (now - self._turned_s)
        left = np.array(goals) - self._wiring.relaxed - self._wound
        most, wanted = float(self._most_speed), np.rint(left / (unit * self._pace.period_s))
        self._speed = np.clip(wanted, -most, most)
        self._write(Register.SPEED, self._speed.astype(int).tolist())
        self._turned_s = now

    def _set(self, register: Register, value: int) -> None:
        self._write(register, [value] * self.n_muscles)

    def _write(self, register: Register, values: Sequence[int]) -> None:
        if register in self._bus.registers:
            self._link.send(self._bus.sync_write(register, dict(zip(self._ids, values, strict=True))))

    def _read(self, register: Register, wait_s: float) -> Mapping[int, int]:
        """Reads a number of every servo; those that do not answer in time are left out."""
        until = self._pace.clock() + wait_s
        found: dict[int, int] = {}
        for question, asked in self._bus.questions(register, self._ids):
            self._link.send(question)
            while not found.keys() >= set(asked) and (left := until - self._pace.clock()) > 0:
                for servo, instruction, parameters in self._decoder.feed(self._link.receive(left)):
                    status = self._bus.status(instruction, parameters)
                    if status is None or servo not in asked or len(status[1]) != self._bus.registers[register][1]:
                        self.partner.wrong("a packet that is no answer")
                    elif status[0]:
                        raise SimulationStopped(
                            f"servo {servo} at {self._link.name} reports error {status[0]:#04x} (overload, "
                            "overheating, wrong voltage, or a number that it does not take)"
                        )
                    else:
                        found[servo] = int.from_bytes(status[1], "little")
                self.partner.rejected(self._decoder.rejected, "packet")
        return found
