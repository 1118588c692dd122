"""Rich's console for text that may contain anything. Importing it loads rich."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import rich.console
from rich.segment import Segment
from rich.text import Text

from annelid.text import printable


class Console(rich.console.Console):
    """Rich's console, which takes no markup from text and passes on no control characters but its own."""

    def __init__(self, **options: Any) -> None:
        """Takes the options of rich's."""
        super().__init__(markup=False, emoji=False, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """Returns a cell, a title or a line."""
        return super().render_str(printable(text), **options)

    def render(self, renderable: Any, options: Any = None) -> Iterable[Segment]:
        """Yields what is written, in pieces."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else segment._replace(text=printable(segment.text))
