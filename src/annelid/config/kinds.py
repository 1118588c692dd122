"""Kinds of controllers, bodies, their parts and arenas: what each kind offers, and how a configuration names one.

A kind is a subclass of one of the families below in a module of its own: its fields, its checks, what it builds, its
citations, and what can be changed while it runs. Defining the class registers it. Another package adds kinds by an
entry point of the group `annelid.registry.KINDS`, which names the module that defines them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from inspect import get_annotations
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeVar

from pydantic import SerializeAsAny, WrapValidator
from pydantic_core import PydanticCustomError

from annelid.config.sections import Section
from annelid.registry import Registry


@dataclass(frozen=True)
class Knob:
    """A field that can be changed while a worm runs, with the range of its slider.

    Attributes:
        field: Dotted path in the configuration.
        label: What it is, with the unit that is shown.
        scale: What is shown over the value in the field's own unit.
        low: Least that is shown.
        high: Most that is shown.
        step: Between two values that are shown.
        hint: What changing it does.
    """

    field: str
    label: str
    scale: float
    low: float
    high: float
    step: float
    hint: str

    def shown(self, config: Section) -> float:
        """Returns the value that a configuration has, as it is shown."""
        value: Any = config
        for name in self.field.split("."):
            value = getattr(value, name)
        # Without the last bits, which a change of units adds and a slider would print.
        return min(max(float(f"{self.scale * float(value):.10g}"), self.low), self.high)

    def value(self, shown: float) -> float:
        """Returns the field's value for a number that is shown."""
        return float(f"{shown / self.scale:.10g}")


def above(value: float, usual: float) -> float:
    """Returns the usual upper end of a slider, or one well above a value beyond it."""
    return usual if value <= usual else two_digits(2.0 * value)


def two_digits(value: float) -> float:
    """Returns two digits of a number, so that sliders end at round ones."""
    return float(f"{value:.2g}")


class Kind(Section):
    """Base of all families: sections of which a configuration chooses one by its field ``kind``.

    Attributes:
        registry: The kinds of its family.
        default: Kind of the family that is meant where none is named.
        cites: Publications that it rests on: keys of ``annelid/data/references.bib`` or of `bibtex`, and what for.
        bibtex: Entries of its own, BibTeX, separated by empty lines.
        suffix: Ending of the files that it is read from by `from_file`; empty for none.
        kind: Its name: a subclass makes it ``Literal["name"] = "name"``.

    Raises:
        ConfigError: On definition, where its family has another kind of that name.
    """

    registry: ClassVar[Registry[type[Any]]]
    default: ClassVar[str]
    cites: ClassVar[tuple[tuple[str, str], ...]] = ()
    bibtex: ClassVar[str] = ""
    suffix: ClassVar[str] = ""
    kind: Any

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        """Registers a class that gives its own field ``kind`` a value."""
        name = cls.model_fields["kind"].default if "kind" in get_annotations(cls) else None
        if isinstance(name, str):
            cls.registry.add(name, cls)

    @classmethod
    def from_file(cls, path: Path) -> dict[str, Any]:
        """Reads tables of a configuration, by name, from a file of the kind's `suffix` that the user has named.

        Raises:
            ConfigError: The file cannot be read, or describes no such thing.
        """
        raise NotImplementedError

    def check_with(self, config: Any) -> None:
        """Checks the section against the rest of the run that it is of.

        Args:
            config: The run's configuration, a `RunConfig`.

        Raises:
            ValueError: They do not fit; the message names the fields, the value and what is valid.
        """

    def cited(self) -> tuple[tuple[str, str], ...]:
        """Returns the publications that this section rests on, as `cites`; depends on its fields where need be."""
        return self.cites

    def knobs(self) -> tuple[Knob, ...]:
        """Returns the section's fields that can be changed while a worm runs."""
        return ()


Family = TypeVar("Family", bound=Kind)


def kinds_of(family: type[Family]) -> dict[str, type[Family]]:
    """Returns the kinds of a family by their names, those of other installed packages too; the default comes first."""
    kinds = sorted(family.registry.all().items(), key=lambda known: known[0] != family.default)
    # A field may admit one kind alone.
    return {name: kind for name, kind in kinds if issubclass(kind, family)}


def kind_of_file(family: type[Family], path: str | Path) -> type[Family] | None:
    """Returns the kind of a family that is read from files of a path's ending; None where there is none."""
    return next((kind for kind in kinds_of(family).values() if kind.suffix and str(path).endswith(kind.suffix)), None)


def every_kind() -> list[type[Kind]]:
    """Returns the kinds of all families."""
    # What is loaded may bring families of its own, such as those of a body's parts.
    for family in Kind.__subclasses__():
        family.registry.all()
    return [kind for family in Kind.__subclasses__() for kind in family.registry.all().values()]


def kinds_in(section: Section) -> set[type[Kind]]:
    """Returns the kinds that a section and those within it are of."""
    within = [value for name in type(section).model_fields if isinstance(value := getattr(section, name), Section)]
    own = {type(section)} if isinstance(section, Kind) else set()
    return own.union(*map(kinds_in, within))


def default_of(family: type[Family]) -> Family:
    """Returns the kind of a family that is meant where none is named, with the defaults of all its fields."""
    return family.registry.find(family.default).model_validate({})


class Choice:
    """Annotation of a field that holds any kind of a family: ``Annotated[ControllerKind, Choice()]``."""

    def __get_pydantic_core_schema__(self, family: type[Kind], handler: Any) -> Any:
        """Validates a mapping as the kind that it names."""

        def choose(value: Any, validate: Any) -> Any:
            if not isinstance(value, Mapping):
                return validate(value)
            name, kinds = value.get("kind", family.default), kinds_of(family)
            if not isinstance(name, str) or name not in kinds:
                valid = {"expected_tags": ", ".join(map(repr, kinds))}
                raise PydanticCustomError("union_tag_invalid", "must be one of {expected_tags}", valid)
            return kinds[name].model_validate(value)

        return handler.generate_schema(SerializeAsAny[Annotated[family, WrapValidator(choose)]])
