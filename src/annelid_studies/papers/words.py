"""Numbers, lists and rhythms in words, as all examinations and claims write them, and the files of these words."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cache
from importlib.resources import files
from math import isfinite, nan
from string import Formatter
from typing import Any

import numpy as np

from annelid.analysis import RhythmScore
from annelid.morphology import Array
from annelid.textfiles import parse_toml

CM, MM, MS, PERCENT = 100.0, 1000.0, 1000.0, 100.0
DASH = "–"
"""Printed where there is no number."""


def capitalised(text: str) -> str:
    """Begins a text with a capital and leaves the rest as it is."""
    return text[:1].upper() + text[1:]


def number(value: float | None) -> float:
    """Returns NaN for None."""
    return nan if value is None else value


def in_unit(value: float | None, scale: float = 1.0, digits: int = 2, sign: str = "") -> str:
    """Formats a number after scaling it, with a plus where ``sign`` is one; a dash for None and NaN."""
    scaled = number(value) * scale
    if not isfinite(scaled):
        return DASH
    text = f"{scaled:{sign}.{digits}f}"
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
    *others, last = ["none", *words]
    return f"{', '.join(others[1:])} and {last}" if others[1:] else last


def by_worm(found: Iterable[Any], text: Callable[[Any], str]) -> str:
    """Lists what is said of things found, each with the label of its ``worm`` in brackets."""
    return listed(f"{text(one)} ({one.worm.label})" for one in found)


def labels(found: Iterable[Any]) -> str:
    """Lists the labels of the worms of things found."""
    return listed(one.worm.label for one in found)


def span(values: Iterable[float] | Array, scale: float = 1.0, digits: int = 2) -> str:
    """Formats the range of some numbers, ``12 to 40``, or the number if all are printed alike."""
    finite = [value for value in np.ravel([*values]) if isfinite(value)]
    if not finite:
        return DASH
    low, high = in_unit(min(finite), scale, digits), in_unit(max(finite), scale, digits)
    return low if low == high else f"{low} to {high}"


def rhythm(score: RhythmScore | None) -> str:
    """Says what a rhythm is, for a table: ``1-2-3, 2.63 s``, ``disordered``, ``silent after 0.74 s``."""
    if score is None:
        return DASH
    if score.verdict == "ordered":
        period = DASH if score.period_s is None else f"{score.period_s:.2f} s"
        if score.direction == 0:
            return f"{score.wave_fronts} fronts, {period}"
        segments = range(1, max(score.order) + 1)[:: score.direction]
        fronts = "" if score.wave_fronts == 1 else f", {score.wave_fronts} fronts"
        return f"{'-'.join(map(str, segments))}{fronts}, {period}"
    if score.verdict == "silent":
        return "silent" if score.last_onset_s is None else f"silent after {score.last_onset_s:.2f} s"
    return score.verdict or "too short to tell"


def kind(score: RhythmScore) -> str:
    """Names the kind of a rhythm, as the legend of the figures does."""
    if score.verdict == "ordered":
        return "1-2-3" if score.is_one_wave else "other order"
    return score.verdict or "too short"


@cache
def texts(name: str) -> Mapping[str, Any]:
    """Reads a file of words, by its path in this package."""
    return parse_toml((files("annelid_studies") / name).read_text(encoding="utf-8"), name)


_UNITS = {"n": 1.0, "cm": CM, "mm": MM, "%": PERCENT}


class _Words(Formatter):
    def format_field(self, value: Any, format_spec: str) -> str:
        unit, _, digits = format_spec.partition(".")
        if unit not in _UNITS:
            return super().format_field(value, format_spec)
        n_digits = int(digits or {"%": 0}.get(unit, 2))
        if value is None or np.ndim(value) == 0:
            return in_unit(value, _UNITS[unit], n_digits)
        return span(value, _UNITS[unit], n_digits)


def filled(text: str, values: Mapping[str, Any]) -> str:
    """Returns a text of such a file on one line, with values in the place of names in braces.

    Beside Python's formats there are ``n``, ``cm``, ``mm`` and ``%``, of a number in its SI unit and with two digits,
    ``%`` with none; ``cm.1`` has one. Several numbers become their range, and a missing one a dash.
    """
    return _Words().vformat(" ".join(text.split()), (), values)
