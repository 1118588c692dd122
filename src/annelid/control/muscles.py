"""How muscles go with segments: one ring each, or a left and a right half."""

from __future__ import annotations

from annelid.errors import ConfigError


def muscles_a_segment(n_segments: int, n_muscles: int) -> int:
    """Returns 1 for whole rings and 2 for half-rings.

    Raises:
        ConfigError: Muscles that are neither one nor two a segment.
    """
    if n_muscles not in (n_segments, 2 * n_segments):
        raise ConfigError(
            f"n_muscles = {n_muscles} does not fit {n_segments} segments: "
            f"give {n_segments} (rings) or {2 * n_segments} (half-rings)"
        )
    return n_muscles // n_segments
