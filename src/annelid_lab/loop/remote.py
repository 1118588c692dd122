"""A body and a controller at the other end of a line, to the loop like any others."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

import numpy as np

from annelid.control import SENSED
from annelid.errors import ConfigError, SimulationStopped
from annelid.protocols import Array, Recordable, Sensation, Signal, Values
from annelid.simulation import Senses
from annelid_lab.loop.frames import Interface
from annelid_lab.loop.session import Limits, Pace, Partner, WirePartner


class PacedPlant(ABC):
    """A robot that moves once in a period, within limits; nothing but what it senses is known of it.

    It records its sensors, the command as it was sent, and the times of the loop. Between two exchanges it is a body
    that does not move, so a network takes all its steps at once.

    Attributes:
        n_segments: Segments.
        n_muscles: Muscles.
        command: What was sent last.
        partner: What is at the end of the line.
    """

    def __init__(
        self, partner: Partner, pace: Pace, limits: Limits, rest_m: Array, n_muscles: int, timestep_s: float
    ) -> None:
        """Makes a robot at rest.

        Args:
            partner: What is at the end of the line.
            pace: The clock.
            limits: On commands.
            rest_m: Mean length of each segment's stretch sensors at rest, m, ``(n_segments,)``.
            n_muscles: Muscles.
            timestep_s: Control step, s.
        """
        self.n_segments, self.n_muscles = len(rest_m), n_muscles
        self.partner, self._pace, self._limits = partner, pace, limits
        self._rest_m, self._timestep_s = rest_m[:, np.newaxis], timestep_s
        self._n_steps = round(pace.period_s / timestep_s)
        self._n_taken, self._is_new = 0, False
        self.command = np.zeros(n_muscles)
        self._sent_s = pace.clock()
        self._sensed: dict[str, Array] = {}
        self._unconfirmed: list[str] = []
        self._senses = Senses(self._sensation)

    @abstractmethod
    def _begin(self) -> None:
        """Makes sure that the robot is there and relaxed."""

    @abstractmethod
    def _transfer(self, command: Array) -> dict[str, Array] | None:
        """Sends a command; returns what is sensed by names in `SENSED`, None if that has not come."""

    @abstractmethod
    def _relax(self) -> str | None:
        """Lets go of all muscles; returns a sentence if that is not certain. No command goes out after it."""

    def stop(self) -> None:
        """Lets go of all muscles, once; whether the robot confirms it is among the doubts."""
        self.command = np.zeros(self.n_muscles)
        self._unconfirmed += filter(None, [self._relax()])

    def reset(self, seed: int) -> Sensation:
        """Connects; returns the first sensation, of the relaxed robot.

        Raises:
            ConfigError: There is no robot, it does not fit, or its sensors cannot be read.
        """
        self._begin()
        self._n_taken, self.command = 0, np.zeros(self.n_muscles)
        self._sensed = {}
        try:
            while not self._sensed:
                self._move(self.command)
        except SimulationStopped as stop:
            raise ConfigError(f"the loop cannot start, since the robot did not answer: {stop}") from None
        self._is_new = True
        return self._sensation()

    def step(self, activation: Array) -> Sensation:
        """Advances by one control step, in the last of a period by the wall clock."""
        return self.stride(activation[np.newaxis])

    def steps_to_move(self) -> int:
        """Returns the control steps to the end of the period."""
        return self._n_steps - self._n_taken % self._n_steps

    def stride(self, activation: Array) -> Sensation:
        """Advances by at most `steps_to_move` control steps."""
        if self._is_new:
            # Since the reset a file was laid out, for which a robot's own watchdog does not wait.
            self._is_new = False
            self._begin()
            self._pace.restart()
        self._n_taken += len(activation)
        if self._n_taken % self._n_steps == 0:
            self._move(activation[-1])
        return self._sensation()

    def recordable(self) -> Recordable:
        """Names what is sensed, the command and the times."""
        command = Signal("command", ("muscle",), (self.n_muscles,), "1", "activation as it was sent, within limits")
        known = self._senses.read(False)
        sensed = (each for each in self._senses.recordable().signals if np.isfinite(known[each.name]).all())
        own = (command, *timing_signals(self.partner, self._pace))
        return Recordable((*sensed, *own), attrs={"hardware": "robot"})

    def read(self, frame: bool) -> Values:
        """Reads them; there are none at frame rate."""
        own = {"command": self.command, **timing_values(self.partner, self._pace)}
        return {} if frame else {**self._senses.read(frame), **own}

    def doubts(self) -> tuple[str, ...]:
        """Returns what went wrong without ending the run."""
        return (*self._unconfirmed, *self.partner.doubts(), *_missed(self._pace))

    def _move(self, activation: Array) -> None:
        self._pace.tick()
        now = self._pace.clock()
        # After a delay no more than after a period, and where a late command is followed by one in time, less.
        self.command = self._limits.within(activation, self.command, min(now - self._sent_s, self._pace.period_s))
        self._sent_s = now
        sensed = self._transfer(self.command)
        if sensed is not None:
            self._sensed = sensed

    def _sensation(self) -> Sensation:
        sensed, n = self._sensed, self.n_segments
        angle = sensed["heading_rad"][0] if "heading_rad" in sensed else math.nan
        unknown = np.full(self.n_muscles, math.nan)
        return Sensation(
            time_s=self._n_taken * self._timestep_s,
            stretch_m=self._rest_m + sensed.get("lengthening_m", np.full(n, math.nan))[:, np.newaxis],
            rest_stretch_m=self._rest_m,
            ring_length_m=unknown,
            muscle_force_N=unknown,
            contact_force_N=np.full((n, 3), math.nan),
            center_of_mass_m=np.full(3, math.nan),
            touch_N=sensed.get("touch_N", np.zeros((0, 4))),
            front_m=np.append(sensed.get("front_m", np.full(2, math.nan)), 0.0),
            heading=np.array([-math.cos(angle), -math.sin(angle), 0.0]),
        )


class RemotePlant(PacedPlant):
    """A robot that speaks the protocol of docs/wire.md."""

    partner: WirePartner

    def __init__(self, partner: WirePartner, pace: Pace, limits: Limits, rest_m: Array, interface: Interface) -> None:
        """Makes a robot at rest, as `PacedPlant`."""
        super().__init__(partner, pace, limits, rest_m, interface.n_muscles, interface.timestep_us / 1e6)
        self._interface = interface

    def _begin(self) -> None:
        self.partner.connect()

    def _transfer(self, command: Array) -> dict[str, Array] | None:
        values = self.partner.exchange(command)
        return None if values is None else self._interface.split(values)

    def _relax(self) -> str | None:
        return self.partner.stop(self.command)


class RemoteController:
    """A controller that speaks the protocol of docs/wire.md; it is asked once in a period.

    Attributes:
        name: For the run file.
        partner: What is at the end of the line.
    """

    name = "firmware over the wire"

    def __init__(
        self, partner: WirePartner, pace: Pace, interface: Interface, n_steps: int, *, keeps_pace: bool
    ) -> None:
        """Takes what is at the end of the line; ``keeps_pace`` where the body does not wait for the clock itself."""
        self.partner, self._pace, self._interface = partner, pace, interface
        self._n_steps, self._keeps_pace = n_steps, keeps_pace
        self._n_taken = 0
        self._activation = np.zeros(interface.n_muscles)

    def reset(self, seed: int) -> None:
        """Connects, by which the firmware returns to its initial state."""
        self.partner.connect()
        self._n_taken, self._activation = 0, np.zeros(self._interface.n_muscles)

    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step; what the firmware is given at the first of a period counts during all of it."""
        if self._n_taken % self._n_steps == 0:
            if self._n_taken == 0:
                # As a robot: between reset and first step may be more than its watchdog waits.
                self.partner.connect()
            if self._keeps_pace:
                self._pace.tick()
            sensed = [np.ravel(SENSED[name].read(sensation)) for name in self._interface.senses]
            activation = self.partner.exchange(np.concatenate(sensed))
            if activation is not None:
                self._activation = activation
        self._n_taken += 1
        return self._activation

    def stride(self, sensation: Sensation, n_steps: int) -> Array:
        """Advances by control steps."""
        return np.stack([self.step(sensation) for _ in range(n_steps)])

    def stop(self) -> None:
        """Ends the session."""
        self.partner.stop()

    def recordable(self) -> Recordable:
        """Names the times."""
        signals = timing_signals(self.partner, self._pace if self._keeps_pace else None)
        return Recordable(signals, attrs={"hardware": "firmware" if self._keeps_pace else "robot and firmware"})

    def read(self, frame: bool) -> Values:
        """Reads them; there are none at frame rate."""
        return {} if frame else timing_values(self.partner, self._pace if self._keeps_pace else None)

    def doubts(self) -> tuple[str, ...]:
        """Returns what went wrong without ending the run."""
        return (*self.partner.doubts(), *(_missed(self._pace) if self._keeps_pace else ()))


def timing_signals(partner: Partner, pace: Pace | None) -> tuple[Signal, ...]:
    """Names the latency of a partner, and of the clock, if its keeper asks, how late commands leave."""
    latency = Signal(
        f"{partner.who}_latency", (), (), "s", f"time that the {partner.who} took to answer; NaN: no answer in time"
    )
    late = Signal("command_lateness", (), (), "s", "time from the beginning of the period to the command")
    missed = Signal("missed_deadlines", (), (), "1", "deadlines missed so far")
    return (latency,) if pace is None else (latency, late, missed)


def timing_values(partner: Partner, pace: Pace | None) -> Values:
    """Reads what `timing_signals` names."""
    values = {f"{partner.who}_latency": partner.latest_latency_s}
    if pace is not None:
        values |= {"command_lateness": pace.late_s[-1] if pace.late_s else 0.0, "missed_deadlines": float(pace.missed)}
    return values


def _missed(pace: Pace) -> tuple[str, ...]:
    if not pace.missed:
        return ()
    return (f"missed deadlines: {pace.missed}; the loop fell {pace.slipped_s:.3g} s behind the wall clock",)
