"""Refusals name the field, its bad value and the valid ones."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from annelid.errors import ConfigError, require_at_least, require_negative, require_positive

LEAST = 5e-324
"""The smallest positive number there is."""


def at_least_three(**values: float) -> None:
    require_at_least(3, **values)


@pytest.mark.parametrize(
    ("require", "good", "bad", "words"),
    [
        (require_positive, (LEAST, 1, math.inf), (0.0, -0.0, -LEAST, -math.inf, math.nan), "must be positive, not"),
        (require_negative, (-LEAST, -1, -math.inf), (0.0, -0.0, LEAST, math.inf, math.nan), "must be negative, not"),
        (at_least_three, (3, 3.0, math.inf), (2, 2.9999999999999996, -math.inf, math.nan), "must be at least 3, not"),
    ],
)
def test_the_first_value_beyond_the_bound_is_refused_by_its_name(
    require: Callable[..., None], good: tuple[float, ...], bad: tuple[float, ...], words: str
) -> None:
    require(**{f"good_{number}": value for number, value in enumerate(good)})
    for value in bad:
        with pytest.raises(ConfigError, match=f"^range_mV {words} {value}$"):
            require(fine=good[0], range_mV=value, also_bad=bad[0])
