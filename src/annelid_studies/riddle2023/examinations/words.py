"""Numbers, lists and rhythms in words, as all examinations and claims write them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import isfinite
from typing import Protocol, TypeVar

import numpy as np

from annelid.analysis import RhythmScore
from annelid.morphology import Array
from annelid_studies.riddle2023.examinations.design import Reading, Worm, number

CM, MM, PERCENT = 100.0, 1000.0, 100.0
NOTHING = "–"
"""Printed where there is no number."""


def capitalised(text: str) -> str:
    """Begins a text with a capital and leaves the rest as it is."""
    return text[:1].upper() + text[1:]


def in_unit(value: float | None, scale: float = 1.0, digits: int = 2) -> str:
    """Formats a number after scaling it; a dash for None and NaN."""
    scaled = number(value) * scale
    if not isfinite(scaled):
        return NOTHING
    text = f"{scaled:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text.replace("-", "−")


def in_cm(value_m: float | None, digits: int = 2) -> str:
    """Formats a length in cm, without the unit."""
    return in_unit(value_m, CM, digits)


def in_percent(fraction: float | None, digits: int = 0) -> str:
    """Formats a fraction in percent, without the sign."""
    return in_unit(fraction, PERCENT, digits)


def each_in_unit(values: Iterable[float | None], scale: float = 1.0, digits: int = 2) -> str:
    """Formats one number a segment, for example ``4.24 / 2.58 / 3.84``."""
    return " / ".join(in_unit(value, scale, digits) for value in values)


def all_in_cm(values_m: Iterable[float | None], digits: int = 2) -> str:
    """Formats one length a segment in cm."""
    return each_in_unit(values_m, CM, digits)


def listed(words: Iterable[str]) -> str:
    """Joins words as English does: ``a, b and c``; ``none`` without any."""
    words = list(words)
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}" if words else "none"


class OfWorm(Protocol):
    """What was found of one worm."""

    @property
    def worm(self) -> Worm:
        """The worm."""
        ...


Found = TypeVar("Found", bound=OfWorm)


def told(found: Iterable[Found], text: Callable[[Found], str]) -> str:
    """Lists what is said of things found, each with its worm's label in brackets."""
    return listed(f"{text(one)} ({one.worm.label})" for one in found)


def labels(readings: Iterable[Reading]) -> str:
    """Lists the worms of readings."""
    return listed(one.worm.label for one in readings)


def span(values: Iterable[float] | Array, scale: float = 1.0, digits: int = 2) -> str:
    """Formats the range of some numbers, ``12 to 40``, or the number if all are printed alike."""
    finite = [value for value in np.ravel([*values]) if isfinite(value)]
    if not finite:
        return NOTHING
    low, high = in_unit(min(finite), scale, digits), in_unit(max(finite), scale, digits)
    return low if low == high else f"{low} to {high}"


def rhythm(score: RhythmScore | None) -> str:
    """Says what a rhythm is, for a table: ``1-2-3, 2.63 s``, ``disordered``, ``silent after 0.74 s``."""
    if score is None:
        return NOTHING
    if score.verdict == "ordered":
        period = NOTHING if score.period_s is None else f"{score.period_s:.2f} s"
        if score.direction == 0:
            return f"{score.wave_fronts} fronts, {period}"
        n = max(score.order)
        segments = range(1, n + 1) if score.direction == 1 else range(n, 0, -1)
        fronts = "" if score.wave_fronts == 1 else f", {score.wave_fronts} fronts"
        return f"{'-'.join(map(str, segments))}{fronts}, {period}"
    if score.verdict == "silent":
        return "silent" if score.last_onset_s is None else f"silent after {score.last_onset_s:.2f} s"
    return score.verdict or "too short to tell"


def kind(score: RhythmScore) -> str:
    """Names the kind of a rhythm, as the legend of `draw_rhythms` does."""
    if score.verdict == "ordered":
        return "1-2-3" if score.is_one_wave else "other order"
    return score.verdict or "too short"
