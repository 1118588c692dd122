"""Rich's console for text that may contain anything, and its progress bar. Importing it loads rich."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import rich.console
from rich.segment import Segment
from rich.text import Text

from annelid.text import printable

__all__ = ["REFRESH_S", "Console", "progress_bar"]

REFRESH_S = 0.1
"""How long a progress bar stays as it is, at least, s."""


class Console(rich.console.Console):
    """Rich's console, which takes no markup from text and passes on no control characters but its own."""

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """Returns a cell, a title or a line."""
        return super().render_str(printable(text), **options)

    def render(self, renderable: Any, options: Any = None) -> Iterable[Segment]:
        """Yields what is written, in pieces."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else segment._replace(text=printable(segment.text))


@contextmanager
def progress_bar(*, forced: bool = False, transient: bool = False) -> Iterator[Callable[[str, float, str], None]]:
    """Shows a progress bar, and the time that is left, on stderr as long as the block runs.

    Args:
        forced: Show it also where stderr is no terminal.
        transient: Take it away at the end.

    Yields:
        What draws it: called with the text before the bar, the share that is done, and the text behind it.
    """
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    bar = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.fields[behind]}", markup=False),
        TimeRemainingColumn(compact=True),
        console=Console(stderr=True, force_terminal=True if forced else None),
        transient=transient,
        # The caller refreshes it; a thread of its own would compete with the physics for the core.
        auto_refresh=False,
    )
    with bar:
        task, drawn = bar.add_task("", total=1.0, behind=""), -math.inf

        def draw(before: str, share: float, behind: str) -> None:
            nonlocal drawn
            late = time.monotonic() - drawn > REFRESH_S
            bar.update(task, description=before, completed=share, behind=behind, refresh=late)
            drawn = time.monotonic() if late else drawn

        yield draw
