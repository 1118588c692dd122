"""What the sections of the planar worms have in common."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from annelid.config import BodyKind, NonNegative, Positive

if TYPE_CHECKING:
    from annelid.config import RunConfig
    from annelid.protocols import Array, Values


class PlanarWorm(BodyKind):
    """What every planar worm has: its segments are rhombi in a row, of ``heights`` from one field to another."""

    is_planar = True
    frame_size = (1280, 320)
    video_size = (960, 256)
    n_segments: Annotated[int, Field(ge=3, le=200)] = Field(  # pyright: ignore[reportIncompatibleMethodOverride]
        default=3, description="actuated segments"
    )
    side_m: Positive = Field(default=0.073, description="side of a rhombus")
    heights: ClassVar[tuple[str, str]]

    @model_validator(mode="after")
    def _heights_fit_the_rhombus(self) -> Self:
        low, high = self.heights
        if not getattr(self, low) < getattr(self, high) < 2 * self.side_m:
            raise ValueError(
                f"body.{low} = {getattr(self, low):g} and body.{high} = {getattr(self, high):g} must satisfy "
                f"{low} < {high} < 2 side_m = {2 * self.side_m:g}"
            )
        return self

    def check_with(self, config: RunConfig) -> None:
        """Checks that no arena is given."""
        if config.arena is not None:
            raise ValueError(f"arena has no effect on body.kind = {self.kind!r}, which touches no ground")


class DynamicPlanarWorm(PlanarWorm):
    """What the planar worms with masses and forces share; no paper in hand states these constants.

    They are those of a light robot of the size of Riddle 2022's: sides and heights are that worm's, spring and muscle
    balance near its contracted height, the damper gives its time constant of about 0.1 s.
    """

    heights = ("height_shortest_m", "height_relaxed_m")

    def outlines(self, values: Values) -> Array:
        """Returns the sides of the segments, bent as they are, as `BodyKind.outlines`."""
        return bent_rhombi(np.asarray(values["outline"], dtype=float), self.n_segments)

    height_relaxed_m: Positive = Field(default=0.11, description="height at which the return spring is slack")
    height_shortest_m: Positive = Field(default=0.055, description="height at which a muscle's force has fallen to 0")
    joint_mass_kg: Positive = Field(default=0.05, description="mass of a joint on the axis")
    vertex_mass_kg: Positive = Field(default=0.05, description="mass of an upper or a lower vertex")
    spring_stiffness_N_per_m: Positive = Field(default=200.0, description="return spring along a segment")
    muscle_force_N: NonNegative = Field(default=19.0, description="of a fully active muscle at the relaxed height")
    height_damping_Ns_per_m: NonNegative = Field(
        default=35.0, description="viscous resistance to a change of a segment's height"
    )


def bent_rhombi(outline: Array, n_segments: int) -> Array:
    """Closes each segment's part of the upper outline with its mirror image.

    Args:
        outline: Corners of the upper side, front to back, m, ``(.., n_segments * n + 1, 2)``.
        n_segments: Segments.

    Returns:
        Corners round each segment, shape ``(.., n_segments, 2 n, 2)``.
    """
    n = (outline.shape[-2] - 1) // n_segments
    upper = outline[..., n * np.arange(n_segments)[:, np.newaxis] + np.arange(n + 1), :]
    return np.concatenate([upper, upper[..., -2:0:-1, :] * [1.0, -1.0]], axis=-2)


def rhombi(lengths: Array, heights: Array) -> Array:
    """Puts rhombi in a row with its middle at the origin.

    Args:
        lengths: Horizontal diagonals, m, ``(.., n_segments)``.
        heights: Vertical diagonals, m, ``(.., n_segments)``.

    Returns:
        Corners (left, top, right, bottom), shape ``(.., n_segments, 4, 2)``.
    """
    ends = np.cumsum(lengths, axis=-1) - lengths.sum(axis=-1, keepdims=True) / 2
    corners = np.zeros((*lengths.shape, 4, 2))
    corners[..., 0, 0], corners[..., 2, 0] = ends - lengths, ends
    corners[..., 1::2, 0] = (ends - lengths / 2)[..., np.newaxis]
    corners[..., 1, 1], corners[..., 3, 1] = heights / 2, -heights / 2
    return corners
