"""A line in memory with a clock of its own, on which anything may go wrong."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from annelid.protocols import Array
from annelid_lab.loop.frames import Decoder, Frame, Interface, Kind, Role
from annelid_lab.loop.peer import Peer

INTERFACE = Interface(("lengthening_m",), 3, 3, 1000)


class FakeClock:
    """Time that passes only where something waits."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        # Time passes by itself too, or a loop that only looks at the clock would not end.
        self.now += 1e-7
        return self.now

    def sleep(self, time_s: float) -> None:
        self.now += max(time_s, 0.0)


class Body:
    """A robot that contracts at once and notes all that it is told."""

    def __init__(self) -> None:
        self.commands: list[Array] = []
        self.activation = np.zeros(3)
        self.relaxed = 0

    def move(self, activation: Array, n_steps: int) -> Array:
        self.commands.append(activation)
        self.activation = activation
        return 0.06 * activation

    def relax(self) -> None:
        self.relaxed += 1
        self.activation = np.zeros(3)


class Line:
    """Both directions of a line between a host and a peer; ``fault(direction, n, data)`` says what arrives of a send.

    It returns pairs of a delay, s, and bytes; OSError is a line that is gone.
    """

    name = "memory"

    def __init__(
        self, peer: Peer, clock: FakeClock, fault: Callable[[str, int, bytes], list[tuple[float, bytes]]] | None = None
    ) -> None:
        self.peer, self.clock = peer, clock
        self.fault = fault or (lambda direction, n, data: [(0.0, data)])
        self.queues: dict[str, list[tuple[float, int, bytes]]] = {"to": [], "from": []}
        self.counts = {"to": 0, "from": 0}
        self.sent: list[Frame] = []
        self._decoder = Decoder()
        self._at = clock.now

    def send(self, data: bytes) -> None:
        self.sent += self._decoder.feed(data)
        self._put("to", self.clock.now + 0.0005, data)

    def receive(self, timeout_s: float) -> bytes:
        until = self.clock.now + max(timeout_s, 0.0)
        while True:
            events = [(queue[0][0], name) for name, queue in self.queues.items() if queue]
            when, name = min(events, default=(np.inf, ""))
            if when > until:
                self._pass(until)
                return b""
            self._pass(max(when, self.clock.now))
            data = self.queues[name].pop(0)[2]
            if name == "from":
                return data[:4096]
            if answer := self.peer.receive(data):
                self._put("from", self.clock.now + 0.0005, answer)

    def close(self) -> None:
        pass

    def _pass(self, until: float) -> None:
        self.clock.now = max(until, self.clock.now)
        self.peer.elapsed(self.clock.now - self._at)
        self._at = self.clock.now

    def _put(self, direction: str, at: float, data: bytes) -> None:
        self.counts[direction] += 1
        n = self.counts[direction]
        arrivals = self.fault(direction, n, data)
        self.queues[direction] += [(at + delay, n, part) for delay, part in arrivals if part]
        self.queues[direction].sort(key=lambda each: each[0])


def robot(body: Body) -> Peer:
    return Peer(Role.BODY, INTERFACE, body.move, body.relax)


def kind_of(data: bytes) -> Kind | None:
    return next((frame.kind for frame in Decoder().feed(data)), None)
