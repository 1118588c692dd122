"""What all sections of a configuration share: their base, and the kinds of numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from annelid.text import is_line


def _line(text: str) -> str:
    if not is_line(text):
        raise ValueError("must be one line of text without control characters")
    return text


Line = Annotated[str, AfterValidator(_line)]
"""Text that is shown in tables, titles and file names."""
Positive = Annotated[float, Field(gt=0, le=1e15)]
NonNegative = Annotated[float, Field(ge=0, le=1e15)]
Share = Annotated[float, Field(ge=0, le=1)]
Length = Annotated[float, Field(ge=1e-6, le=1e3)]
"""Of a part of a body, m."""
Modulus = Annotated[float, Field(ge=1.0, le=1e13)]
"""Of a material, Pa."""
Impedance = tuple[Annotated[float, Field(gt=0, lt=1)], Annotated[float, Field(gt=0, lt=1)], Positive]
Seed = Annotated[int, Field(ge=0, lt=2**128)]
Range = tuple[Positive, Positive]


class Section(BaseModel):
    """Base of every section: immutable, and no field but the declared ones."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _unset(cls, given: Any) -> Any:
        """Takes "none" for a number that is not set, which TOML cannot say otherwise."""
        if not isinstance(given, Mapping):
            return given
        absent = {name for name, field in cls.model_fields.items() if field.default is None}
        return {name: None if name in absent and value == "none" else value for name, value in given.items()}
