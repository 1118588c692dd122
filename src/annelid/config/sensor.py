"""How the nervous system reads its segments' lengths."""

from __future__ import annotations

from pydantic import Field

from annelid.config.sections import NonNegative, Section


class StretchSensor(Section):
    """How the nervous system reads its segments' lengths."""

    tolerance_m: NonNegative = Field(default=0.010, description="on while a segment is within this of its rest length")
    hysteresis_m: NonNegative = Field(default=0.0, description="once on, stays on until this much beyond the tolerance")
    startup_hold_s: NonNegative = Field(
        default=0.2, description="sensor of segment 1 held off for this long at the start"
    )
    noise_m: NonNegative = Field(default=0.0, description="standard deviation of the noise on every reading")
