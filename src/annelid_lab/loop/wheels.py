"""Speeds that a firmware sends to wheels, as the controller of a simulated worm whose cables the wheels wind."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence

import numpy as np

from annelid.errors import ConfigError
from annelid.protocols import Array, Sensation
from annelid_lab.loop.dynamixel import BROADCAST, PROTOCOLS, STEPS_PER_TURN, SYNC_WRITE, Register
from annelid_lab.loop.pseudo_robot import PseudoRobot
from annelid_lab.loop.servos import MOST_SPEED, Wiring


class Wheels:
    """A simulated robot of wheels that takes speed words at their times, and sets the lengths of a worm's cables.

    A wheel that is paid out beyond ``relaxed`` leaves its cable slack, and winds it first. With a stall torque, a
    speed is a share of a motor's output: a cable of tension T on a spool of radius r adds ``T r / stall torque`` of the
    speed without load to a wheel that pays out, and takes it from one that winds. A wheel that is stopped holds. At
    ``contracted`` a segment is as narrow as it can be, and its wheel stalls.

    Attributes:
        robot: The simulated robot; its servo k pulls muscle k.
    """

    def __init__(
        self,
        words: Iterable[tuple[float, int, int]],
        servos: Sequence[int],
        wiring: Wiring,
        *,
        cable_m: float,
        stall_torque_Nm: float = math.inf,
    ) -> None:
        """Makes wheels at rest.

        Args:
            words: Time, s, number of a servo in the firmware, and word for its register of speed, in order of time.
            servos: Number in the firmware of the servo of each muscle: left before right, segment by segment.
            wiring: Positions, protocol and unit of speed; with ``is_wheel``.
            cable_m: Length of cable from relaxed to contracted, m.
            stall_torque_Nm: Torque at which full output stalls, N m; infinite for servos that keep their speed.

        Raises:
            ConfigError: The servos are no wheels, or a word is for one that pulls no muscle.
        """
        if not wiring.is_wheel:
            raise ConfigError("is_wheel is False, and speed words drive wheels: make Wiring(.., is_wheel=True)")
        self._words, self._wiring = list(words), wiring
        self._muscle_of = {servo: muscle for muscle, servo in enumerate(servos, start=1)}
        if unknown := {servo for _, servo, _ in self._words} - self._muscle_of.keys():
            raise ConfigError(f"servos has {list(servos)}, and words are for {sorted(unknown)}: name these, too")
        steps = wiring.relaxed - wiring.contracted
        radius_m = cable_m / (2 * math.pi * abs(steps) / STEPS_PER_TURN)
        full = MOST_SPEED * wiring.steps_per_s
        self._gives_way_per_N = math.copysign(full * radius_m / stall_torque_Nm, steps)
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Returns to relaxed wheels at time zero."""
        self._time_s, n = 0.0, len(self._muscle_of)
        self.robot = PseudoRobot(n, n, wiring=self._wiring, clock=lambda: self._time_s)
        self._due, self._bus = deque(self._words), PROTOCOLS[self._wiring.protocol]
        self.robot.send(self._bus.sync_write(Register.TORQUE, dict.fromkeys(range(1, n + 1), 1)))

    def step(self, sensation: Sensation) -> Array:
        """Turns the wheels up to now, under the tension that the cables have now, and takes the words that are due."""
        self._time_s = sensation.time_s
        self.robot.given_way = self._gives_way_per_N * sensation.muscle_force_N
        self.robot.receive(0.0)
        while self._due and self._due[0][0] <= self._time_s:
            _, servo, word = self._due.popleft()
            data = word.to_bytes(self._bus.registers[Register.SPEED][1], "little", signed=word < 0)
            place = self._bus.place(Register.SPEED) + bytes([self._muscle_of[servo]])
            self.robot.send(self._bus.packet(BROADCAST, SYNC_WRITE, place + data))
        self.robot.position[self.robot.contraction > 1.0] = self._wiring.contracted
        return np.maximum(self.robot.contraction, 0.0)
