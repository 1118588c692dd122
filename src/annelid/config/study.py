"""A sweep as a user writes it: a preset, what is the same in every run, what is varied, and how it is sampled."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from annelid.config.checking import check_section
from annelid.config.loading import seen_from
from annelid.config.sections import Line, Section, Seed
from annelid.textfiles import check_depth, read_toml

Design = Literal["grid", "random", "lhs", "sobol"]
MOST_RUNS = 100_000
HOW = "give values = [..], choices = [..], or from, to and, in a grid, number"


class Vary(Section):
    """One field that is varied: over numbers, over choices, or over a range."""

    field: str = Field(description="dotted path of the field; its unit may be left out")
    values: tuple[float, ...] | None = Field(default=None, description="numbers")
    choices: tuple[Any, ...] | None = Field(default=None, description="words, lists or tables")
    from_: float | None = Field(default=None, alias="from", description="lower end of a range")
    to: float | None = Field(default=None, description="upper end of a range")
    log: bool = Field(default=False, description="equal ratios count alike, rather than equal differences")
    number: Annotated[int, Field(ge=2, le=MOST_RUNS)] | None = Field(
        default=None, description="values of a range that a grid takes, both ends among them"
    )
    follow: Mapping[str, float] = Field(
        default_factory=dict, description="other fields, each with the ratio to this one that it keeps"
    )

    @model_validator(mode="after")
    def _says_one_thing(self) -> Self:
        is_range = self.from_ is not None or self.to is not None
        ways = sum((self.values is not None, self.choices is not None, is_range))
        if ways != 1:
            raise ValueError(f"vary {self.field!r} says {'nothing' if not ways else 'two things'} to take: {HOW}")
        if self.follow and self.choices is not None:
            raise ValueError(f"vary {self.field!r}: follow needs numbers, values = [..] or from and to, not choices")
        listed = self.values if self.values is not None else self.choices
        if listed is not None:
            if self.log or self.number is not None:
                raise ValueError(f"vary {self.field!r}: log and number are of a range only, from .. to ..")
            # Choices may be lists and tables, which have no hash.
            if len(listed) < 1 or len({repr(one) for one in listed}) < len(listed):
                raise ValueError(f"vary {self.field!r}: must list at least one value, and none twice")
            return self
        if self.from_ is None or self.to is None or not self.from_ < self.to:
            raise ValueError(
                f"vary {self.field!r}: from = {self.from_} must be given, and be below to = {self.to}".replace(
                    "None", "(nothing)"
                )
            )
        if self.log and self.from_ <= 0.0:
            raise ValueError(f"vary {self.field!r}: from = {self.from_:g} must be above 0 where log = true")
        return self


class Study(Section):
    """A sweep over fields of a configuration."""

    name: Line = Field(default="sweep", max_length=200, description="for titles")
    preset: str = Field(description="name of a preset, or a TOML file, seen from the folder of this one")
    set: Mapping[str, Any] = Field(default_factory=dict, description="fields that are the same in every run")
    vary: Annotated[tuple[Vary, ...], Field(min_length=1)] = Field(description="the fields that are varied")
    design: Design = Field(default="grid", description="every combination, or samples of the ranges")
    samples: Annotated[int, Field(ge=1, le=MOST_RUNS)] | None = Field(
        default=None, description="how many, but for a grid"
    )
    seed: Seed = Field(default=0, description="of the samples")
    repeats: Annotated[int, Field(ge=1, le=MOST_RUNS)] = Field(
        default=1, description="runs of each combination, with seeds of their own"
    )
    outputs: tuple[str, ...] = Field(default=(), description="numbers that are kept; all where it is left out")
    rank: str | None = Field(default=None, description="the number that the table and the figure tell first")
    keep: Literal["runs", "outcomes"] = Field(default="runs", description="all files of every run, or its numbers only")

    @model_validator(mode="after")
    def _samples_are_not_of_a_grid(self) -> Self:
        if self.design == "grid":
            if self.samples is not None:
                raise ValueError(f"samples = {self.samples}: has no effect on design = 'grid', which takes all")
            for vary in self.vary:
                if vary.from_ is not None and vary.number is None:
                    raise ValueError(f"vary {vary.field!r}: number must be given in a grid: how many from .. to ..")
            return self
        if self.samples is None:
            raise ValueError(f"samples must be given for design = {self.design!r}")
        for vary in self.vary:
            if vary.number is not None:
                raise ValueError(
                    f"vary {vary.field!r}: number = {vary.number} has no effect on design = {self.design!r}, "
                    "which takes samples"
                )
        return self


def load_study(source: str | Path | Mapping[str, Any] | Study) -> Study:
    """Loads and checks a study.

    Args:
        source: The path of a TOML file, a nested mapping, or a study, which is returned as it is.

    Raises:
        ConfigError: The file cannot be read, or a field is unknown or out of its range.
    """
    if isinstance(source, Study):
        return source
    if isinstance(source, Mapping):
        check_depth(source, "the study")
        tree = source
    else:
        tree = {"name": Path(source).stem, **read_toml(Path(source), "the study")}
        if isinstance(preset := tree.get("preset"), str):
            tree["preset"] = seen_from(Path(source).parent, preset)
    return check_section(Study, tree)
