"""What every line to hardware shares: the pace of the wall clock, watchdog, limits, and the exchange of frames."""

from __future__ import annotations

import math
import secrets
import time
from array import array
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from annelid.errors import ConfigError, SimulationStopped, require_positive
from annelid.protocols import Array
from annelid_lab.loop.frames import Decoder, Frame, FrameError, Hello, Interface, Kind, Role, packed
from annelid_lab.loop.links import Link

ON_TIME = 0.1
"""A command is on time if it leaves within this share of a period."""
STOP_TRIES, STOP_WAIT_S = 5, 0.05
"""How often a stop is sent, and how long each time its confirmation is waited for, s."""
ANSWER = 0.5
"""An answer is lost unless it comes within this share of a period; the rest is for computing."""
_CONNECT_S = 5.0
_ASK_EVERY_S = 0.5
_AHEAD_S = 0.0005


def percentiles(times_s: array[float]) -> dict[str, float | None]:
    """Returns the percentiles of times that are reported, s, to a microsecond; None where there are no times."""
    shares = {"median": 50.0, "p99": 99.0, "p99_9": 99.9, "max": 100.0}
    if not times_s:
        return dict.fromkeys(shares)
    found = np.percentile(times_s, [*shares.values()], method="inverted_cdf")
    return dict(zip(shares, found.round(6).tolist(), strict=True))


@dataclass(slots=True)
class Pace:
    """The clock of the loop: one exchange in every period.

    Attributes:
        period_s: Period, s.
        clock: Time that never goes back, s.
        sleep: Waits so many seconds.
        late_s: How long after its time each command left, s.
        missed: Deadlines that were missed: commands that left late, and periods without one.
        slipped_s: By how much the loop is behind the wall clock in all, s.
    """

    period_s: float
    clock: Callable[[], float] = time.perf_counter
    sleep: Callable[[float], None] = time.sleep
    late_s: array[float] = field(default_factory=lambda: array("d"))
    missed: int = 0
    slipped_s: float = 0.0
    _due_s: float | None = None

    def tick(self) -> None:
        """Waits for the beginning of the next period, which begins now where that has passed by a period or more."""
        now = self.clock()
        self._due_s = due = now if self._due_s is None else self._due_s + self.period_s
        if due - now > _AHEAD_S:
            self.sleep(due - now - _AHEAD_S)
        # A sleep ends some 0.1 ms late: the last bit is waited for awake.
        while (now := self.clock()) < due:
            pass
        late_s = now - due
        self.late_s.append(late_s)
        if late_s > ON_TIME * self.period_s:
            self.missed += 1 + int(late_s / self.period_s)
        if late_s >= self.period_s:
            self.slipped_s += late_s
            self._due_s = now

    def restart(self) -> None:
        """Begins anew at the next `tick`, which is then on time."""
        self._due_s = None


@dataclass(frozen=True, slots=True)
class Limits:
    """What is sent to a robot, whatever the controller says.

    Attributes:
        lowest: Least activation.
        highest: Largest activation.
        rate_per_s: Largest change of activation in a second.

    Raises:
        ConfigError: Not 0 <= lowest < highest <= 1, or a rate that is not positive.
    """

    lowest: float = 0.0
    highest: float = 1.0
    rate_per_s: float = math.inf

    def __post_init__(self) -> None:
        """Checks the numbers."""
        if not 0 <= self.lowest < self.highest <= 1:
            raise ConfigError(
                f"limits of activation must be 0 <= lowest < highest <= 1, not {self.lowest} and {self.highest}"
            )
        require_positive(rate_per_s=self.rate_per_s)

    def within(self, activation: Array, before: Array, time_s: float) -> Array:
        """Returns the command nearest to an activation, so long after the command before, s."""
        step = self.rate_per_s * time_s
        return np.clip(np.clip(activation, self.lowest, self.highest), before - step, before + step)


class Partner:
    """The hardware at the other end of a line, as far as it does not matter what it says: watchdog and counts.

    Attributes:
        who: "robot" or "firmware", for sentences and names.
        link: The line.
        pace: The clock.
        latency_s: From each command to its answer, s; answers that were lost are left out.
        latest_latency_s: Of the last command, s; NaN if its answer was lost.
        lost: Exchanges without a valid answer in time.
    """

    def __init__(self, who: str, link: Link, pace: Pace, watchdog: int) -> None:
        """Takes a line; after ``watchdog`` periods without an answer the loop stops."""
        self.who, self.link, self.pace, self.watchdog = who, link, pace, watchdog
        self.latency_s = array("d")
        self.latest_latency_s = math.nan
        self.lost = self._in_a_row = 0
        self._wrong: Counter[str] = Counter()

    def answered(self, latency_s: float | None) -> None:
        """Takes note of an exchange: how long the answer took, or None for none.

        Raises:
            SimulationStopped: None for too long.
        """
        if latency_s is not None:
            self.latency_s.append(latency_s)
            self.latest_latency_s, self._in_a_row = latency_s, 0
            self._wrong.clear()
            return
        self.latest_latency_s = math.nan
        self.lost += 1
        self._in_a_row += 1
        if self._in_a_row >= self.watchdog:
            n, self._in_a_row = self._in_a_row, 0
            raise SimulationStopped(
                f"no answer of the {self.who} at {self.link.name} for {n} periods of {self.pace.period_s:g} s: "
                f"{self.what_came()}"
            )

    def wrong(self, what: str) -> None:
        """Takes note of something that came and is no answer."""
        self._wrong[what] += 1

    def rejected(self, counts: Counter[str], what: str) -> None:
        """Takes over a decoder's counts of what was not valid, by the reason."""
        for reason, n in counts.items():
            self._wrong[f"a {what} with {reason}"] += n
        counts.clear()

    def what_came(self) -> str:
        """Returns what came since the last answer, in words."""
        return ", ".join(f"{n} x {what}" for what, n in sorted(self._wrong.items())) or "nothing came"

    def line_lost(self, error: OSError) -> SimulationStopped:
        """Returns what to raise where the line is gone."""
        reason = error.strerror or str(error) or type(error).__name__
        return SimulationStopped(f"the line to the {self.who} at {self.link.name} is gone: {reason}")

    def doubts(self) -> tuple[str, ...]:
        """Returns how many answers were lost, if any."""
        return (f"lost answers of the {self.who}: {self.lost}",) if self.lost else ()

    def to_dict(self) -> dict[str, object]:
        """Returns what is reported."""
        return {"latency_s": percentiles(self.latency_s), "lost": self.lost}


class WirePartner(Partner):
    """A partner that speaks the protocol of docs/wire.md; annelid begins every exchange."""

    def __init__(self, role: Role, link: Link, pace: Pace, interface: Interface, n_steps: int, watchdog: int) -> None:
        """Takes a line, who is at its end, and what passes between both in so many control steps."""
        super().__init__("robot" if role == Role.BODY else "firmware", link, pace, watchdog)
        self._role, self._interface = role, interface
        self._sent, self._comes = Kind.SENSATION, Kind.ACTIVATION
        self._n_coming = interface.n_muscles
        if role == Role.BODY:
            self._sent, self._comes, self._n_coming = self._comes, self._sent, interface.n_sensed
        silence_ms = min(max(math.ceil(1e3 * watchdog * pace.period_s), 1), 0xFFFF)
        self._hello = Hello.of(Role.HOST, interface, n_steps, silence_ms)
        self._decoder = Decoder()
        self._session = self._sequence = 0
        self._is_open = False

    def connect(self) -> None:
        """Says hello until it is answered.

        Raises:
            ConfigError: Nobody answers, or the other side is made for another worm, protocol or part.
        """
        clock, payload = self.pace.clock, self._hello.payload()
        end = clock() + _CONNECT_S
        reason: object = ""
        while clock() < end:
            # A new session each time, so that no frame of an earlier one counts.
            self._session, self._sequence = secrets.randbelow(0x10000), 0
            try:
                self.link.send(Frame(Kind.HELLO, self._session, 0, payload).encoded())
                frame = self._await(Kind.HELLO, min(end, clock() + _ASK_EVERY_S))
            except OSError as error:
                # A program that does not listen yet.
                reason = f": {error.strerror or error}"
                self.pace.sleep(_ASK_EVERY_S)
                continue
            if frame is None:
                continue
            try:
                misfit = self._hello.misfit(Hello.read(frame.payload), self._role)
            except FrameError as error:
                misfit = f"its hello has {error}"
            if misfit is not None:
                raise ConfigError(f"the {self.who} at {self.link.name} does not fit this worm: {misfit}")
            self._is_open = True
            return
        came = reason or f": {self.what_came()}"
        raise ConfigError(f"no {self.who} answers at {self.link.name} within {_CONNECT_S:g} s{came}")

    def exchange(self, numbers: Array) -> Array | None:
        """Sends numbers and returns those of the answer; None if none came in time.

        Raises:
            SimulationStopped: The watchdog's time is over, the line is gone, or the other side stopped.
        """
        if not self._is_open:
            raise SimulationStopped(f"the {self.who} has been stopped")
        self._sequence = (self._sequence + 1) & 0xFFFF
        frame = Frame(self._sent, self._session, self._sequence, packed(numbers))
        values, began = None, self.pace.clock()
        try:
            self.link.send(frame.encoded())
            answer = self._await(self._comes, began + ANSWER * self.pace.period_s)
        except OSError as error:
            raise self.line_lost(error) from None
        if answer is not None:
            try:
                values = answer.numbers(self._n_coming)
            except FrameError as error:
                raise SimulationStopped(f"the {self.who} at {self.link.name} sent {error}") from None
        self.answered(None if answer is None else self.pace.clock() - began)
        return values

    def stop(self, *last: Array) -> str | None:
        """Sends a last command and ends the session; returns a sentence unless the other side confirms that."""
        if not self._is_open:
            return None
        self._is_open = False
        error: object = ""
        for _ in range(STOP_TRIES):
            try:
                for numbers in last:
                    self._sequence = (self._sequence + 1) & 0xFFFF
                    self.link.send(Frame(self._sent, self._session, self._sequence, packed(numbers)).encoded())
                self.link.send(Frame(Kind.STOP, self._session, self._sequence).encoded())
                if self._await(Kind.STOP, self.pace.clock() + STOP_WAIT_S) is not None:
                    return None
            except (OSError, SimulationStopped) as reason:
                error = f": {reason}"
        return f"the {self.who} at {self.link.name} did not confirm that it stopped{error}"

    def _await(self, kind: Kind, until: float) -> Frame | None:
        """Returns the frame of a kind that answers the latest one sent, or None if it has not come by a time."""
        clock = self.pace.clock
        while (left := until - clock()) > 0:
            data = self.link.receive(left)
            for frame in self._decoder.feed(data):
                if frame.session != self._session:
                    self.wrong("a frame of another session")
                elif kind == Kind.HELLO and frame.kind == kind:
                    return frame
                elif frame.kind == Kind.STOP:
                    if kind == Kind.STOP:
                        return frame
                    raise SimulationStopped(f"the {self.who} at {self.link.name} asks to stop")
                elif frame.kind == Kind.ERROR:
                    number = frame.payload[0] if frame.payload else "without a number"
                    raise SimulationStopped(f"the {self.who} at {self.link.name} reports error {number}")
                elif frame.kind != kind:
                    self.wrong("a frame of another kind")
                elif frame.sequence != self._sequence:
                    self.wrong("an answer that is late, twice or out of order")
                else:
                    return frame
            self.rejected(self._decoder.rejected, "frame")
        return None
