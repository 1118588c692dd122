"""What all sections of a configuration share: their base, and the kinds of numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Self, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Discriminator, Field, Tag, model_validator

from annelid.errors import ConfigError, shown
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
Friction = Annotated[float, Field(ge=0.01, le=100)]
Level = Annotated[float, Field(gt=0, le=1)]
"""Of an activation that is not nothing."""
Length = Annotated[float, Field(ge=1e-6, le=1e3)]
"""Of a part of a body, m."""
Modulus = Annotated[float, Field(ge=1.0, le=1e13)]
"""Of a material, Pa."""
Impedance = tuple[Annotated[float, Field(gt=0, lt=1)], Annotated[float, Field(gt=0, lt=1)], Positive]
Seed = Annotated[int, Field(ge=0, lt=2**128)]
Range = tuple[Positive, Positive]
Number = TypeVar("Number", bound=float)


def _not_empty(value: Any) -> Any:
    if value == ():
        raise ValueError("must be a number, or a list of numbers, one per segment")
    return value


def _form(value: Any) -> str:
    return "list" if isinstance(value, list | tuple) else "one"


PerSegmentOf = Annotated[
    Annotated[Number, Tag("one")] | Annotated[tuple[Number, ...], Tag("list")],
    Discriminator(_form),
    AfterValidator(_not_empty),
]
"""One number of a kind for all segments, or one for each; the section names the field in `Section.segment_fields`."""


class Section(BaseModel):
    """Base of every section: immutable, and no field but the declared ones.

    Attributes:
        segment_fields: Names of the fields of type `PerSegmentOf`.
    """

    # Most of the kinds are in no configuration: pydantic completes a section when it is first used.
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True)
    segment_fields: ClassVar[tuple[str, ...]] = ()

    def of_each(self, name: str, n_segments: int) -> list[float]:
        """Returns the numbers that a field has for every segment, of a number one for each."""
        value = getattr(self, name)
        return list(value) if isinstance(value, tuple) else [value] * n_segments

    def one_number(self, name: str) -> float:
        """Returns the number that a field has for all segments.

        Raises:
            ConfigError: Its segments differ.
        """
        value = getattr(self, name)
        first, *others = value if isinstance(value, tuple) else (value,)
        if any(other != first for other in others):
            raise ConfigError(
                f"{name} = {shown(list(value))} differs among the segments; this needs one number for all"
            )
        return first

    def of_segment(self, segment: int) -> Self:
        """Returns the section as it would be if all segments were as one of them, counted from 0."""
        lists = {
            name: value[segment] for name in self.segment_fields if isinstance(value := getattr(self, name), tuple)
        }
        return self.model_copy(update=lists) if lists else self

    @model_validator(mode="before")
    @classmethod
    def _unset(cls, given: Any) -> Any:
        """Takes "none" for a number that is not set, which TOML cannot say otherwise."""
        if not isinstance(given, Mapping):
            return given
        absent = {name for name, field in cls.model_fields.items() if field.default is None}
        return {name: None if name in absent and value == "none" else value for name, value in given.items()}
