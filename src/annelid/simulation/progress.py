"""How far a run has come: a progress bar on a terminal, or the caller's own function."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

ProgressCallback = Callable[[float, float], object]
"""Called with the simulated time of the run, s, and the wall-clock time spent on it so far, s."""


@contextmanager
def reporting(
    progress: bool | ProgressCallback | None, start_s: float, end_s: float
) -> Iterator[ProgressCallback | None]:
    """Gives the function to call as the run goes on, or None if nobody wants to know.

    Args:
        progress: Own function; True for a bar in any case, False for none, None for one where stderr is
            a terminal.
        start_s: Simulated time at which this run starts, s.
        end_s: Simulated time at which it ends, s.
    """
    if callable(progress):
        yield progress
    elif progress or (progress is None and sys.stderr.isatty()):
        with _bar(start_s, end_s, forced=bool(progress)) as update:
            yield update
    else:
        yield None


@contextmanager
def _bar(start_s: float, end_s: float, forced: bool) -> Iterator[ProgressCallback]:
    from annelid.terminal import progress_bar

    with progress_bar(forced=forced) as draw:

        def update(simulated_s: float, wall_s: float) -> None:
            factor = (simulated_s - start_s) / wall_s if wall_s > 0 else 0.0
            left = f"{clock_text((end_s - simulated_s) / factor)} left" if factor > 0 else ""
            text = f"simulated {simulated_s:.2f} of {end_s:g} s"
            draw(text, simulated_s / end_s, f"{factor:.3g} x real time  {left}")

        yield update


def clock_text(duration_s: float) -> str:
    """Returns a duration as ``m:ss`` or ``h:mm:ss``."""
    minutes, seconds = divmod(round(duration_s), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{seconds:02d}" if hours else f"{minutes}:{seconds:02d}"
