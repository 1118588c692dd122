"""An empty figure in the project's style, and its two files: vector and pixels."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from annelid.draw.style import STYLE
from annelid.output import whole_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH_IN = 7.2
"""Width of a figure across a page, inches."""


@contextmanager
def canvas(height_in: float, width_in: float = WIDTH_IN) -> Iterator[Figure]:
    """Gives an empty figure without a window or global state; draw and save it inside the block.

    Args:
        height_in: Height, inches.
        width_in: Width, inches.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(width_in, height_in), layout="constrained")
        FigureCanvasAgg(figure)
        yield figure


def save(figure: Figure, path: str | Path) -> Path:
    """Writes a figure in the format of the path's suffix; the file appears only when it is whole."""
    path = Path(path)
    with whole_file(path) as draft:
        figure.savefig(draft, metadata=_UNDATED.get(path.suffix.lower()))
    return path


def save_both(figure: Figure, stem: str | Path) -> Path:
    """Writes a figure as vectors and as pixels.

    Args:
        figure: The figure.
        stem: Path without suffix; ``<stem>.svg`` and ``<stem>.png`` are written.

    Returns:
        The path of the PNG.

    Raises:
        RunFileError: A file cannot be written.
    """
    stem = Path(stem)
    save(figure, stem.with_name(f"{stem.name}.svg"))
    # All lies where it shall: to lay it out again would take as long as to draw it.
    figure.set_layout_engine("none")
    return save(figure, stem.with_name(f"{stem.name}.png"))


# Without the date, the same numbers give the same file.
_UNDATED = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
