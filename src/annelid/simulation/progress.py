"""How far a run has come, by a progress bar or the caller's own function, and the user's request to end it."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, Self

ProgressCallback = Callable[[float, float], object]
"""Called with the simulated time of the run, s, and the wall-clock time spent on it so far, s."""
SIGNALS = tuple(signal.Signals[name] for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Those that ask a process to end; Windows has no SIGHUP."""


@contextmanager
def reporting(
    progress: bool | ProgressCallback | None, start_s: float, end_s: float
) -> Iterator[ProgressCallback | None]:
    """Gives the function to call as the run goes on from one simulated time to another, or None if nobody listens.

    Args:
        progress: Own function; True for a bar in any case, False for none, None for one where stderr is a terminal.
        start_s: Simulated time at which this run starts, s.
        end_s: Simulated time at which it ends, s.
    """
    if callable(progress) or not (progress or (progress is None and sys.stderr.isatty())):
        yield progress if callable(progress) else None
        return
    from annelid.terminal import progress_bar

    with progress_bar(forced=bool(progress)) as draw:

        def update(simulated_s: float, wall_s: float) -> None:
            factor = (simulated_s - start_s) / wall_s if wall_s > 0 else 0.0
            text = f"simulated {simulated_s:.2f} of {end_s:g} s"
            draw(text, simulated_s / end_s, f"{factor:.3g} x real time")

        yield update


class Interruption:
    """While entered, the first signal of `SIGNALS` sets `requested`; a second one raises KeyboardInterrupt.

    Signals reach Python's main thread only, so in any other thread this does nothing. A signal that the
    process was started to ignore stays ignored.

    Attributes:
        requested: Name of the signal that asked for the end, or None.
    """

    def __init__(self) -> None:
        self.requested: str | None = None
        self._previous: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for number in SIGNALS:
                previous = signal.getsignal(number)
                # None stands for a handler that was not installed from Python and could not be put back.
                if previous not in (None, signal.SIG_IGN):
                    self._previous[number] = signal.signal(number, self._handle)
        return self

    def __exit__(self, *_: object) -> None:
        while self._previous:
            signal.signal(*self._previous.popitem())

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self.requested is not None:
            raise KeyboardInterrupt
        self.requested = signal.Signals(number).name
