"""How far a study has come: a bar on a terminal, now and then a line elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

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

        with progress_bar(transient=True) as draw:
            yield lambda stage, done, total, share: draw(stage, share, _counted(done, total))
    else:
        yield Lines(sys.stderr)


class Lines:
    """Writes a plain line at most every ten seconds."""

    def __init__(self, stream: TextIO, *, at_once: bool = True) -> None:
        """Takes where to write; the first line comes at once, or after ten seconds."""
        self._stream = stream
        self._last = -float("inf") if at_once else time.monotonic()

    def __call__(self, stage: str, done: int, total: int, share: float) -> None:
        """Takes note of how far a stage has come."""
        now = time.monotonic()
        if now - self._last >= LINE_EVERY_S:
            self._last = now
            words = filter(None, (_counted(done, total), f"{share:.0%}"))
            self._stream.write(": ".join(filter(None, (stage, ", ".join(words)))) + "\n")
            self._stream.flush()


def _counted(done: int, total: int) -> str:
    return f"{done} of {total} runs" if total else ""
