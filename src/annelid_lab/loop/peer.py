"""The other side of the wire in Python: a robot's body, or a controller, that answers annelid."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

import numpy as np

from annelid.protocols import Array
from annelid_lab.loop.frames import MOST_STEPS, Decoder, Frame, FrameError, Hello, Interface, Kind, Role, packed
from annelid_lab.loop.links import Link


class Fault(Exception):
    """What a peer's step raises where the robot has failed: ``Fault(number)``, 1 .. 255, ends the session."""


class Peer:
    """Answers frames as the C client does: a pure function of the bytes and the time.

    Attributes:
        is_open: Whether it obeys a host now.
    """

    def __init__(
        self,
        role: Role,
        interface: Interface,
        step: Callable[[Array, int], Array],
        relax: Callable[[], object] = lambda: None,
    ) -> None:
        """Makes a peer.

        Args:
            role: ``Role.BODY`` or ``Role.CONTROLLER``.
            interface: What passes between both.
            step: Takes what came, (activation or all that is sensed, in one array) and the control steps that it stands
                for; returns what goes back.
            relax: Called at a new session, a stop and after a long silence: a robot lets go of all muscles, a
                controller returns to its initial state.
        """
        self._role, self._interface, self._step, self._relax = role, interface, step, relax
        body = role == Role.BODY
        self._comes, self._goes = (Kind.ACTIVATION, Kind.SENSATION) if body else (Kind.SENSATION, Kind.ACTIVATION)
        self._n_coming = interface.n_muscles if body else interface.n_sensed
        self._decoder = Decoder()
        self._session = self._last = -1
        self._n_steps = self._silence_ms = 1
        self._silent_s = 0.0
        self.is_open = False

    def receive(self, data: bytes) -> bytes:
        """Takes bytes from the line and returns those to answer, which may be none."""
        return b"".join(answer.encoded() for frame in self._decoder.feed(data) if (answer := self._answer(frame)))

    def elapsed(self, time_s: float) -> None:
        """Takes note of time that has passed, s: after a long silence it relaxes and waits for a new session."""
        self._silent_s += time_s
        if self.is_open and 1e3 * self._silent_s > self._silence_ms:
            self._close()

    def _close(self) -> None:
        self.is_open = False
        self._relax()

    def _answer(self, frame: Frame) -> Frame | None:
        if frame.kind == Kind.HELLO:
            return self._answer_hello(frame)
        if frame.session != self._session:
            return None
        if frame.kind == Kind.STOP:
            self._close()
            return Frame(Kind.STOP, frame.session, frame.sequence)
        ahead = (frame.sequence - self._last) & 0xFFFF
        if not self.is_open or frame.kind != self._comes or not 0 < ahead < 0x8000:
            return None
        try:
            values = frame.numbers(self._n_coming)
        except FrameError:
            return None
        if self._comes == Kind.ACTIVATION and not ((values >= 0) & (values <= 1)).all():
            return None
        self._last, self._silent_s = frame.sequence, 0.0
        try:
            returned = self._step(values, self._n_steps)
        except Fault as fault:
            self._close()
            return Frame(Kind.ERROR, frame.session, frame.sequence, bytes(fault.args[:1]))
        return Frame(self._goes, frame.session, frame.sequence, packed(returned))

    def _answer_hello(self, frame: Frame) -> Frame | None:
        try:
            hello = Hello.read(frame.payload)
        except FrameError:
            return None
        mine = Hello.of(self._role, self._interface, hello.n_steps, hello.silence_ms)
        # A hello of a session that has begun may come twice or late: it must not begin again, nor end a stop.
        if frame.session != self._session:
            self._close()
            self._session, self._last = frame.session, frame.sequence
            self._n_steps, self._silence_ms, self._silent_s = hello.n_steps, hello.silence_ms, 0.0
            fits = mine.misfit(hello, Role.HOST) is None
            self.is_open = fits and 1 <= hello.n_steps <= MOST_STEPS and hello.silence_ms > 0
        return Frame(Kind.HELLO, frame.session, frame.sequence, mine.payload())


def serve(link: Link, peer: Peer, until: Callable[[], bool], clock: Callable[[], float] = monotonic) -> None:
    """Answers a host on a line until told to end, then relaxes.

    Args:
        link: The line.
        peer: What answers.
        until: Whether to end, asked every 20 ms at least.
        clock: Time, s.
    """
    try:
        before = clock()
        while not until():
            if answer := peer.receive(link.receive(0.02)):
                link.send(answer)
            now = clock()
            peer.elapsed(now - before)
            before = now
    finally:
        peer.elapsed(np.inf)
