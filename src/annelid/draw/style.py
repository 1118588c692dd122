"""One look for all of the project's figures, readable in grey as well as in colour."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from annelid.text import printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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


def segment_colors(n_segments: int) -> list[Any]:
    """Returns one colour a segment, dark to light from front to rear.

    Args:
        n_segments: Any number; beyond four they are taken from the viridis colour map.

    Returns:
        Colours as matplotlib takes them.
    """
    if n_segments <= len(_FEW):
        return list(_FEW[:n_segments])
    import numpy as np
    from matplotlib import colormaps

    return [tuple(rgba) for rgba in colormaps["viridis"](np.linspace(0.0, 0.88, n_segments))]


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
    """Writes a panel's title, plain text, above its left edge."""
    axes.set_title(plain(text), pad=5.0)
