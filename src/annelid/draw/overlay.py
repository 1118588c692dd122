"""What a picture of a 3D worm has beside the worm: background, legend, scale bar and time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from annelid.errors import RunFileError, suggest

Entry = tuple[str, Sequence[float], str]  # name, colour and look, ``line`` or ``ball``

LEAST_WIDTH = 400  # pixels; in smaller pictures words of a legend could not be read
_CM = 100.0
_TEXT_SHARE, _LEAST_TEXT = 1 / 42, 10.0  # height of the text in the picture's height, and in pixels
_EDGE = 0.012  # distance from the picture's edges, in its width
_BAR_SHARE = 0.2  # the scale bar is the longest round length that is no longer than this share of the width
_PLATE = 166  # opacity of what lies behind the words, of 255


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
"""By name: the checkerboard below a sky, or floor and sky of one colour, for papers and slides."""


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
        paper: Colour behind them, three numbers from 0 to 1.
    """

    def __init__(
        self, size: tuple[int, int], entries: Sequence[Entry], pixels_per_m: float, ink: str, paper: Sequence[float]
    ) -> None:
        width, height = size
        self._ink, self._plate = ink, (*_bytes(paper), _PLATE)
        self._text = round(max(_LEAST_TEXT, _TEXT_SHARE * height))
        self._edge = round(_EDGE * width)
        font = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
        self._font = ImageFont.truetype(font, self._text)
        self._still = Image.new("RGBA", size)
        if width >= LEAST_WIDTH:
            self._draw_bar(bar_length(width, pixels_per_m), pixels_per_m)
            self._draw_legend(entries)

    def stamped(self, picture: NDArray[np.uint8], caption: str) -> NDArray[np.uint8]:
        """Returns a picture, ``(height, width, 3)``, with the words on it."""
        words = self._still.copy()
        if caption:
            draw = ImageDraw.Draw(words)
            place = (self._edge, words.height - self._edge)
            left, top, right, bottom = draw.textbbox(place, caption, self._font, anchor="lb")
            draw.rectangle((left - 4, top - 4, right + 4, bottom + 4), self._plate)
            draw.text(place, caption, self._ink, self._font, anchor="lb")
        return np.array(Image.alpha_composite(Image.fromarray(picture).convert("RGBA"), words).convert("RGB"))

    def _draw_bar(self, length_m: float, pixels_per_m: float) -> None:
        """Draws the scale bar in the lower right corner, with its length above."""
        draw, length = ImageDraw.Draw(self._still), length_m * pixels_per_m
        right, below = self._still.width - self._edge, self._still.height - self._edge
        draw.rectangle((round(right - length), below - 3, right - 1, below - 1), self._ink)
        draw.text((right - length / 2, below - 6), length_name(length_m), self._ink, self._font, anchor="mb")

    def _draw_legend(self, entries: Sequence[Entry]) -> None:
        """Draws the entries in rows from the upper left corner."""
        draw, unit = ImageDraw.Draw(self._still), self._text
        lengths = [2.0 * unit + self._font.getlength(name) for name, _, _ in entries]
        columns = len(entries)
        if sum(lengths) + unit * columns > self._still.width:
            columns = math.ceil(columns / 2)
        widths = [max(lengths[column::columns]) + unit for column in range(columns)]
        rows = math.ceil(len(entries) / max(columns, 1))
        draw.rectangle((0, 0, sum(widths) + unit / 2, 1.6 * unit * rows), self._plate)
        for number, (name, rgb, look) in enumerate(entries):
            x, y = unit / 2 + sum(widths[: number % columns]), 1.6 * unit * (number // columns + 0.5)
            if look == "ball":
                draw.circle((x + 0.7 * unit, y), 0.3 * unit, _bytes(rgb))
            else:
                draw.rectangle((x, y - 0.15 * unit, x + 1.4 * unit, y + 0.15 * unit), _bytes(rgb))
            draw.text((x + 2.0 * unit, y), name, self._ink, self._font, anchor="lm")


def _bytes(rgb: Sequence[float]) -> tuple[int, int, int]:
    red, green, blue = (round(255 * channel) for channel in rgb[:3])
    return red, green, blue


def bar_length(width: int, pixels_per_m: float) -> float:
    """Returns the length of a scale bar, m: 1, 2 or 5 times a power of ten."""
    longest_m = _BAR_SHARE * width / pixels_per_m
    power = 10.0 ** math.floor(math.log10(longest_m))
    return max(factor * power for factor in (1.0, 2.0, 5.0) if factor * power <= longest_m * (1 + 1e-9))


def length_name(length_m: float) -> str:
    """Writes a length with its unit."""
    return f"{_CM * length_m:g} cm" if length_m < 1.0 else f"{length_m:g} m"
