"""How far the report has come: a bar on a terminal, now and then a line elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import TextIO

from annelid.simulation.progress import clock_text

StudyProgress = Callable[[str, int, int, float], object]
"""Called with the stage, the number of its runs done, their total, and the share of its work that is done."""

LINE_EVERY_S = 30.0


def in_stage(progress: StudyProgress | None, stage: str) -> Callable[[int, int, float], object] | None:
    """Returns what `Store.compute` calls as the runs of one stage go on.

    Args:
        progress: What the progress of the whole study is reported to; None for nothing, and then the result is None.
        stage: The stage, in a few words.
    """
    return None if progress is None else partial(progress, stage)


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
    """Foretells the end of a stage from the share of its work that was done since it began."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Begins; ``clock`` tells the time in s."""
        self._clock = clock
        self._stage: str | None = None
        self._start = (0.0, 0.0)

    def __call__(self, stage: str, share: float) -> float | None:
        """Returns the time left in s, or None as long as there is nothing to tell it from."""
        now = self._clock()
        if stage != self._stage or share < self._start[1]:
            self._stage, self._start = stage, (now, share)
        began, before = self._start
        return (now - began) * (1.0 - share) / (share - before) if share > before else None


class Lines:
    """Writes a plain line at most every half minute."""

    def __init__(self, stream: TextIO, clock: Callable[[], float] = time.monotonic) -> None:
        """Writes to a stream; ``clock`` tells the time in s."""
        self._stream = stream
        self._clock = clock
        self._left = TimeLeft(clock)
        self._last = -float("inf")

    def __call__(self, stage: str, done: int, total: int, share: float) -> None:
        """Takes note of how far a stage has come."""
        left, now = self._left(stage, share), self._clock()
        if now - self._last >= LINE_EVERY_S:
            self._last = now
            text = _text(done, total, left)
            self._stream.write(f"{stage}: {text}\n" if text else f"{stage}\n")
            self._stream.flush()


def _text(done: int, total: int, left_s: float | None) -> str:
    runs = f"{done} of {total} runs" if total else ""
    left = f"about {clock_text(left_s)} left" if left_s else ""
    return ", ".join(part for part in (runs, left) if part)
