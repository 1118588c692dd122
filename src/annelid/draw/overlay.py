"""What a picture of a 3D worm has beside the worm: background, legend, scale bar and time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from annelid.draw.canvas import canvas
from annelid.errors import RunFileError, suggest

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend
    from matplotlib.lines import Line2D

Entry = tuple[str, Sequence[float], str]  # name, colour and look, ``line`` or ``ball``

LEAST_WIDTH = 400  # pixels; in smaller pictures words of a legend could not be read
_DPI = 100
_CM = 100.0
_TEXT_SHARE, _LEAST_TEXT = 1 / 42, 10.0  # height of the text in the picture's height, and in pixels
_EDGE = 0.012  # distance from the picture's edges, in its width
_BAR_SHARE = 0.2  # the scale bar is the longest round length that is no longer than this share of the width
_PLATE = 0.65  # opacity of what lies behind the words


DIM, BRIGHT = 0.5, 0.7  # light from all sides: on the checkerboard, and where the floor is to be of one colour
_PIN = (0.25, 0.25, 0.28, 1.0)


@dataclass(frozen=True, slots=True)
class Background:
    """What a worm is drawn on, and what has to differ from it."""

    floor: Sequence[float] | None  # colour; None for the checkerboard
    haze: Sequence[float]  # what the floor fades into with distance
    ambient: float  # light from all sides
    ball: Sequence[float]  # colour of the crossings
    ink: str  # colour of the words


BACKGROUNDS = {
    "floor": Background(None, (0.94, 0.955, 0.97), DIM, _PIN, "#1a1d21"),
    "white": Background((1.0, 1.0, 1.0), (1.0, 1.0, 1.0), BRIGHT, _PIN, "black"),
    "dark": Background((0.10, 0.11, 0.13), (0.06, 0.066, 0.08), BRIGHT, (0.75, 0.78, 0.82, 1.0), "white"),
}
"""By name: the checkerboard below a sky, or a floor of one colour without a sky, for papers and slides."""


def background_of(name: str) -> Background:
    """Finds a background by its name.

    Raises:
        RunFileError: None has that name.
    """
    if name not in BACKGROUNDS:
        raise RunFileError(f"unknown background {name!r}: {suggest(name, BACKGROUNDS)}")
    return BACKGROUNDS[name]


class Overlay:
    """A legend along the top, time and scale bar along the bottom: where the camera leaves the worm's margin.

    Args:
        size: Width and height of the pictures, pixels.
        entries: What the legend explains.
        pixels_per_m: Size of a metre at the worm's middle.
        ink: Colour of the words.
        paper: Colour behind them.
    """

    def __init__(
        self, size: tuple[int, int], entries: Sequence[Entry], pixels_per_m: float, ink: Any, paper: Any
    ) -> None:
        width, height = size
        text_pt = max(_LEAST_TEXT, _TEXT_SHARE * height) * 72.0 / _DPI
        look: dict[str, Any] = {"size": text_pt, "color": ink}
        bottom = _EDGE * width / height
        still: list[Artist] = []
        with canvas(height / _DPI, width / _DPI) as figure:
            figure.set_dpi(_DPI)
            figure.set_layout_engine("none")
            figure.patch.set_alpha(0.0)
            plate = {"facecolor": paper, "alpha": _PLATE, "edgecolor": "none", "pad": 3.0}
            self._time = figure.text(_EDGE, bottom, "", va="bottom", bbox=plate, **look, animated=True)
            drawn: Any = figure.canvas
            self._canvas: FigureCanvasAgg = drawn
            if width >= LEAST_WIDTH:
                length_m = bar_length(width, pixels_per_m)
                share = length_m * pixels_per_m / width
                right, over = 1.0 - _EDGE, bottom + 0.005
                still.append(
                    figure.text(
                        right - share / 2, over + 0.008, length_name(length_m), ha="center", va="bottom", **look
                    )
                )
                still.append(_bar(figure, right - share, right, over, ink))
                legend = _legend(figure, entries, max(1, len(entries)), look, plate)
                if legend.get_window_extent(drawn.get_renderer()).width > width:
                    legend.remove()
                    legend = _legend(figure, entries, math.ceil(len(entries) / 2), look, plate)
                still += [legend] if entries else []
            drawn.draw()
        self._height = height
        self._still = [self._cut(artist) for artist in still]
        self._behind = drawn.copy_from_bbox(figure.bbox)

    def stamped(self, picture: NDArray[np.uint8], caption: str) -> NDArray[np.uint8]:
        """Returns a picture, ``(height, width, 3)``, with the words on it."""
        pixels = picture.copy()
        for sprite in self._still:
            _blend(pixels, *sprite)
        if caption:
            self._canvas.restore_region(self._behind)
            self._time.set_text(caption)
            self._canvas.figure.draw_artist(self._time)
            _blend(pixels, *self._cut(self._time))
        return pixels

    def _cut(self, artist: Artist) -> tuple[NDArray[np.uint8], int, int]:
        """The drawn pixels of an artist, with the row and column at which they begin."""
        box = artist.get_window_extent(self._canvas.get_renderer()).padded(5.0)
        left, right = max(0, math.floor(box.x0)), math.ceil(box.x1)
        top, low = max(0, math.floor(self._height - box.y1)), math.ceil(self._height - box.y0)
        return np.array(self._canvas.buffer_rgba())[top:low, left:right], top, left


def bar_length(width: int, pixels_per_m: float) -> float:
    """Returns the length of a scale bar, m: 1, 2 or 5 times a power of ten."""
    longest_m = _BAR_SHARE * width / pixels_per_m
    power = 10.0 ** math.floor(math.log10(longest_m))
    return max(factor * power for factor in (1.0, 2.0, 5.0) if factor * power <= longest_m * (1 + 1e-9))


def length_name(length_m: float) -> str:
    """Writes a length with its unit."""
    return f"{_CM * length_m:g} cm" if length_m < 1.0 else f"{length_m:g} m"


def _blend(pixels: NDArray[np.uint8], sprite: NDArray[np.uint8], top: int, left: int) -> None:
    height, width = sprite.shape[:2]
    below = pixels[top : top + height, left : left + width]
    opacity = sprite[: below.shape[0], : below.shape[1], 3:].astype(float) / 255.0
    # Agg's colours are not multiplied by their opacity.
    below[:] = np.rint(opacity * sprite[: below.shape[0], : below.shape[1], :3] + (1.0 - opacity) * below)


def _legend(figure: Figure, entries: Sequence[Entry], columns: int, look: Any, plate: Any) -> Legend:
    return figure.legend(
        handles=[legend_handle(*entry) for entry in entries],
        ncols=columns,
        loc="upper left",
        bbox_to_anchor=(0.0, 1.0),
        borderaxespad=0.3,
        columnspacing=1.2,
        handlelength=1.4,
        prop={"size": look["size"]},
        labelcolor=look["color"],
        frameon=True,
        facecolor=plate["facecolor"],
        framealpha=plate["alpha"],
        edgecolor="none",
    )


def _bar(figure: Figure, left: float, right: float, height: float, ink: Any) -> Artist:
    from matplotlib.lines import Line2D

    bar = Line2D(
        [left, right], [height] * 2, color=ink, linewidth=2.5, solid_capstyle="butt", transform=figure.transFigure
    )
    figure.add_artist(bar)
    return bar


def legend_handle(name: str, rgb: Sequence[float], look: str) -> Line2D:
    """Returns what stands in a legend for an entry.

    Args:
        name: What the legend says.
        rgb: Colour, three numbers from 0 to 1.
        look: ``line`` or ``ball``.
    """
    from matplotlib.lines import Line2D

    red, green, blue = rgb[:3]
    color = red, green, blue
    if look == "ball":
        return Line2D([], [], color="none", marker="o", markerfacecolor=color, markeredgecolor="none", label=name)
    return Line2D([], [], color=color, linewidth=3.0, label=name)
