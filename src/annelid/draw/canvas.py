"""An empty figure in the project's one look, readable in grey as well as in colour; its words, colours and files."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from annelid.output import whole_file
from annelid.text import printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

WIDTH_IN = 7.2  # width of a figure across a page, inches
MOST_ROWS = 6
"""Segments that get a panel; of more some that are evenly spaced."""
STYLE: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e4e6e8",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "lines.linewidth": 1.4,
    "savefig.dpi": 150,
    "svg.hashsalt": "annelid",
    "figure.facecolor": "white",
}

# Dark to light, so that the order of segments survives greyscale; hues far apart for colour-blind eyes.
_FEW = ("#1b2a6b", "#c2410c", "#35b5a0", "#e3b428")
RELAXED = (0.46, 0.49, 0.54)
CONTRACTED = (0.86, 0.16, 0.10)
DASHES: tuple[Any, ...] = ("-", (0, (4.0, 1.4)), (0, (5.0, 1.3, 1.2, 1.3)), (0, (1.2, 1.1)))
MARKERS = ("o", "s", "^", "D", "v")
# Without the date, the same numbers give the same file.
_UNDATED = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}


@contextmanager
def canvas(height_in: float, width_in: float = WIDTH_IN, *, dark: bool = False) -> Iterator[Figure]:
    """Gives an empty figure without a window or global state; draw and save it in the block.

    Args:
        height_in: Height, inches.
        width_in: Width, inches.
        dark: Light words on a dark page.
    """
    from matplotlib import style
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with style.context([STYLE, *(["dark_background", {"grid.color": "0.25"}] if dark else [])]):
        figure = Figure(figsize=(width_in, height_in), layout="constrained")
        FigureCanvasAgg(figure)
        yield figure


def save(figure: Figure, path: str | Path, **options: Any) -> Path:
    """Writes a figure in the format of the path's suffix; the file appears only when it is whole.

    Args:
        figure: The figure.
        path: The file.
        options: Of matplotlib's ``savefig``.
    """
    path = Path(path)
    with whole_file(path) as draft:
        figure.savefig(draft, metadata=_UNDATED.get(path.suffix.lower()), **options)
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
    # All is in its place: another layout would take as long as to draw it.
    figure.set_layout_engine("none")
    return save(figure, stem.with_name(f"{stem.name}.png"))


def segment_colors(n_segments: int) -> list[Any]:
    """Returns one colour per segment, dark to light from front to rear; beyond four they are from viridis."""
    if n_segments <= len(_FEW):
        return list(_FEW[:n_segments])
    from matplotlib import colormaps

    return [tuple(rgba) for rgba in colormaps["viridis"](np.linspace(0.0, 0.88, n_segments))]


def line_looks(n_lines: int) -> list[dict[str, Any]]:
    """Returns colour and dashes of each of several lines, so that they differ in grey and for colour-blind readers."""
    return [{"color": c, "linestyle": d} for c, d in zip(segment_colors(n_lines), cycle(DASHES), strict=False)]


def evenly(n: int, most: int) -> list[int]:
    """Returns at most so many of n places from 0 on, the first and the last among them, evenly spaced."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).round().astype(int)).tolist()


def activation_color(activation: float) -> tuple[float, float, float]:
    """Mixes the colour of a ring muscle from its activation, in [0, 1]: grey at rest, red when contracted."""
    share = min(max(activation, 0.0), 1.0)
    red, green, blue = (low + share * (high - low) for low, high in zip(RELAXED, CONTRACTED, strict=True))
    return red, green, blue


def plain(text: str) -> str:
    """Returns a user's text so that a figure shows it as it is: no formulas, no control characters.

    Matplotlib reads what stands between dollar signs as a formula and leaves labels that begin with an underscore out.
    """
    escaped = printable(text).replace("$", r"\$")
    return f" {escaped}" if escaped.startswith("_") else escaped


def panel_title(axes: Axes, text: str) -> None:
    """Writes a panel's title above its left edge.

    Args:
        axes: The panel.
        text: The title, plain text.
    """
    axes.set_title(plain(text), pad=5.0)


def line_entries(entries: Iterable[tuple[Any, Any, float, str]]) -> list[Line2D]:
    """Legend handles of lines: colour, style, width and text of each."""
    from matplotlib.lines import Line2D

    return [Line2D([], [], color=c, linestyle=s, linewidth=w, label=plain(text)) for c, s, w, text in entries]


def draw_lines(
    axes: Axes, lines: Mapping[str, tuple[ArrayLike, ArrayLike]], *, markers: bool = True, **style: Any
) -> None:
    """Draws numbers over a parameter, ``(n,)`` each; crosses on the lower edge mark where one is NaN.

    Args:
        axes: Where to draw.
        lines: Values of the parameter and numbers, by the name in the legend; each with colour, dashes and marker.
        markers: Whether the lines have markers.
        **style: Further properties of the lines, as matplotlib takes them.
    """
    shapes = cycle(MARKERS if markers else [""])
    for (name, (x, y)), look, marker in zip(lines.items(), line_looks(len(lines)), shapes, strict=False):
        place, value = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        axes.plot(place, value, **{**look, "marker": marker, "label": plain(name), **style})
        mark_lost(axes, place[np.isnan(value)], look["color"])


def mark_lost(axes: Axes, places: ArrayLike, color: Any, height: float = 0.04) -> None:
    """Draws crosses near the lower edge, at a share of the panel's height, where there are no numbers."""
    if np.size(places):
        level = np.full(np.shape(places), height)
        axes.plot(places, level, "x", color=color, transform=axes.get_xaxis_transform(), markersize=5.0)
