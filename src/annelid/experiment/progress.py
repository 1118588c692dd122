"""How far a study has come: a bar on a terminal, now and then a line elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

from annelid.simulation.progress import clock_text

StudyProgress = Callable[[str, int, int, float], object]
"""Called with the stage, the number of its runs done, their total, and the share of its work that is done."""

LINE_EVERY_S = 10.0


@contextmanager
def study_progress(*, quiet: bool = False) -> Iterator[StudyProgress | None]:
    """Gives the function to call as the studies go on, or None where nobody wants to know."""
    if quiet:
        yield None
    elif sys.stderr.isatty():
        from annelid.terminal import progress_bar

        time_left = TimeLeft()
        with progress_bar(transient=True) as draw:
            yield lambda stage, done, total, share: draw(stage, share, _text(done, total, time_left(stage, share)))
    else:
        yield Lines(sys.stderr)


class TimeLeft:
    """Estimates the end of a stage from the share of its work that was done since it began."""

    def __init__(self) -> None:
        self._stage: str | None = None
        self._start = (0.0, 0.0)

    def __call__(self, stage: str, share: float) -> float | None:
        """Returns the time left in s, or None as long as it cannot be known."""
        now = time.monotonic()
        if stage != self._stage or share < self._start[1]:
            self._stage, self._start = stage, (now, share)
        began, before = self._start
        return (now - began) * (1.0 - share) / (share - before) if share > before else None


class Lines:
    """Writes a plain line at most every ten seconds."""

    def __init__(self, stream: TextIO, *, at_once: bool = True) -> None:
        """Takes where to write; the first line comes at once, or after ten seconds."""
        self._stream, self._left = stream, TimeLeft()
        self._last = -float("inf") if at_once else time.monotonic()

    def __call__(self, stage: str, done: int, total: int, share: float) -> None:
        """Takes note of how far a stage has come."""
        left, now = self._left(stage, share), time.monotonic()
        if now - self._last >= LINE_EVERY_S:
            self._last = now
            self._stream.write(": ".join(filter(None, (stage, _text(done, total, left)))) + "\n")
            self._stream.flush()


def _text(done: int, total: int, left_s: float | None) -> str:
    runs = f"{done} of {total} runs" if total else ""
    left = f"about {clock_text(left_s)} left" if left_s else ""
    return ", ".join(filter(None, (runs, left)))
