"""The errors that annelid raises, each with one sentence a user can act on."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import get_close_matches
from math import isfinite
from numbers import Real
from typing import Any

from annelid.text import printable

__all__ = [
    "AnnelidError",
    "ClusterError",
    "ConfigError",
    "MissingDependency",
    "MixedEngine",
    "RenderingUnavailable",
    "RunFileError",
    "RunKilled",
    "SimulationStopped",
    "UnreadableText",
    "listed",
    "require_at_least",
    "require_finite",
    "require_positive",
    "shortened",
    "shown",
    "suggest",
]

MOST_SHOWN = 80
"""Characters of a value in an error sentence."""
MOST_LISTED = 300
"""Characters of the valid names in an error sentence."""


class AnnelidError(Exception):
    """Base of every error that annelid raises on purpose; its text is one readable sentence."""

    def __str__(self) -> str:
        # Names from files of others must not command the terminal that shows them.
        return printable(super().__str__())


class ConfigError(AnnelidError):
    """A configuration names an unknown preset or field, or gives a field a value it cannot have."""


class UnreadableText(ConfigError, ValueError):
    """A text file cannot be read, or is not what it should be; also a ValueError, as parsers raise."""


class RunFileError(AnnelidError):
    """A run file cannot be written, or what was opened is not a readable annelid run."""


class RenderingUnavailable(AnnelidError):
    """No OpenGL back-end works on this machine; the text names the line that installs one."""


class MissingDependency(AnnelidError):
    """An optional package is needed; the text names the line that installs it."""


class MixedEngine(AnnelidError, ImportError):
    """Two versions of the engine are installed over each other; the text names the line that repairs it."""


class ClusterError(AnnelidError):
    """The workers that compute runs cannot be reached, were lost, or have other code than this process."""


class RunKilled(AnnelidError):
    """Every worker that computed a run died."""


class SimulationStopped(AnnelidError):
    """A guard stopped the simulation because energy, height or edge strain ran away."""


def require_positive(**values: float) -> None:
    """Refuses values that are not positive, NaN among them.

    Args:
        values: By the names that the sentence is to use.

    Raises:
        ConfigError: Of the first such value.
    """
    _require("positive", lambda value: value > 0, values)


def require_negative(**values: float) -> None:
    """Refuses values that are not negative, as `require_positive` does those that are not positive."""
    _require("negative", lambda value: value < 0, values)


def require_at_least(least: float, **values: float) -> None:
    """Refuses values below the least one, as `require_positive` does those that are not positive."""
    _require(f"at least {least:g}", lambda value: value >= least, values)


def require_finite(**values: object) -> None:
    """Refuses numbers that are infinite or not a number, as `require_positive` does those that are not positive."""
    _require("a finite number", lambda value: not isinstance(value, Real) or isfinite(value), values)


def _require(what: str, is_met: Callable[[Any], bool], values: Mapping[str, object]) -> None:
    for name, value in values.items():
        if not is_met(value):
            raise ConfigError(f"{name} must be {what}, not {shown(value)}")


def shortened(text: str, most: int = MOST_SHOWN) -> str:
    """Returns a text as it fits into an error sentence: its beginning and its end where it is long."""
    return text if len(text) <= most else f"{text[: most // 2]} .. {text[-most // 4 :]}"


def shown(value: object) -> str:
    """Returns a value as Python writes it, shortened where that is long."""
    try:
        return shortened(repr(value))
    except (ValueError, RecursionError):
        # Python writes no whole number of more than 4,300 digits.
        return "a value too long to be written"


def suggest(name: str, valid: Iterable[str]) -> str:
    """Completes an error sentence with the nearest valid name and the list of all.

    Args:
        name: What the user wrote.
        valid: The names that exist.

    Returns:
        For example ``"did you mean 'riddle2023'? The valid ones are riddle2022-planar, riddle2023"``.
    """
    names = sorted(valid)
    near = nearest(name, names)
    if near is None:
        return f"the valid ones are {listed(names)}"
    return f"did you mean {shortened(near)!r}? The valid ones are {listed(names)}"


def nearest(name: str, valid: Sequence[str]) -> str | None:
    """Returns the valid name that is most like one, or like the last part of its path; None if none is like it.

    Args:
        name: What the user wrote.
        valid: The names that exist.
    """
    for part in (name[:MOST_SHOWN], name[:MOST_SHOWN].rsplit(".", 1)[-1]):
        if near := get_close_matches(part, valid, n=1, cutoff=0.5):
            return near[0]
    return None


def listed(names: Iterable[str]) -> str:
    """Joins names by commas, as many as fit into an error sentence."""
    every = list(names)
    words, length = [], 0
    for name in map(shortened, every):
        length += len(name) + 2
        if length > MOST_LISTED:
            return f"{', '.join(words)} and {len(every) - len(words):,} more"
        words.append(name)
    return ", ".join(words)
