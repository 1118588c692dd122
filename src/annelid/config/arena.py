"""The 3D worm's ground."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from annelid.config.sections import Impedance, NonNegative, Positive, Section


class Arena(Section):
    """Where the worm crawls: flat ground under gravity."""

    friction: Annotated[float, Field(ge=0.01, le=100)] = Field(
        default=1.0, description="coefficient of sliding friction"
    )
    floor_gap_m: NonNegative = Field(default=0.009, description="distance of the floor below the mesh's lowest line")
    gravity_m_per_s2: NonNegative = Field(default=9.81, description="0 for a weightless worm")
    contact_time_constant_s: Positive = Field(default=0.02, description="solref time constant of the contacts")
    contact_impedance: Impedance = Field(
        default=(0.9, 0.95, 0.001), description="solimp (d0, dwidth, width) of the contacts"
    )
