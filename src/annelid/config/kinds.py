"""Kinds of controllers, bodies, their parts and arenas: what each kind offers, and how a configuration names one.

A kind is a subclass of one of the families below in a module of its own: its fields, its checks, what it builds, its
citations, and what can be changed while it runs. Defining the class registers it. Another package adds kinds by an
entry point of the group `annelid.registry.KINDS`, which names the module that defines them.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from inspect import get_annotations
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple, TypeVar

from pydantic import SerializeAsAny, WrapValidator
from pydantic_core import PydanticCustomError

from annelid.config.sections import Section
from annelid.errors import ConfigError
from annelid.registry import Registry

if TYPE_CHECKING:
    from pathlib import Path

    from annelid.config.run import RunConfig
    from annelid.control.open_loop import Contraction
    from annelid.control.turning import Steering
    from annelid.protocols import Controller, Plant


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

    def shown(self, config: RunConfig) -> float:
        """Returns the value that a configuration has, as it is shown."""
        value: Any = config
        for name in self.field.split("."):
            value = getattr(value, name)
        # Without the last bits, which a change of units adds and a slider would print.
        return min(max(float(f"{self.scale * float(value):.10g}"), self.low), self.high)

    def value(self, shown: float) -> float:
        """Returns the field's value for a number that is shown."""
        return float(f"{shown / self.scale:.10g}")


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

    def check_with(self, config: RunConfig) -> None:
        """Checks the section against the rest of a configuration.

        Raises:
            ValueError: They do not fit; the message names the fields, the value and what is valid.
        """

    def cited(self) -> tuple[tuple[str, str], ...]:
        """Returns the publications that this section rests on, as `cites`; depends on its fields where need be."""
        return self.cites

    def knobs(self) -> tuple[Knob, ...]:
        """Returns the section's fields that can be changed while a worm runs."""
        return ()


class ControllerKind(Kind):
    """Base of the controllers' sections.

    Attributes:
        sensor_fields: Fields of the section ``sensor`` that it uses.
        tuned: What `annelid tune` varies unless the user says otherwise, its timing and its sensors' switching: each
            ``FIELD=LOW:HIGH`` or ``FIELD=LOW:HIGH:log``.
    """

    registry: ClassVar[Registry[type[Any]]] = Registry("controller.kind", "annelid.control")
    default: ClassVar[str] = "sns"
    sensor_fields: ClassVar[frozenset[str]] = frozenset()
    tuned: ClassVar[tuple[str, ...]] = ()

    @property
    def scheduled(self) -> tuple[Contraction, ...]:
        """The contractions that are scheduled beforehand, none for a controller that makes them itself."""
        return ()

    @abstractmethod
    def build(self, config: RunConfig, plant: Plant) -> Controller:
        """Builds the controller in its initial state.

        Args:
            config: The configuration that the section is of.
            plant: The body that it drives.

        Raises:
            ConfigError: It cannot be built with these values.
        """


class Goals(NamedTuple):
    """Places on the ground that a worm is steered to.

    Attributes:
        points_m: x and y of each, m.
        reach_m: Distance at which one counts as reached, m.
    """

    points_m: tuple[tuple[float, float], ...] = ()
    reach_m: float = 0.0


class TurningKind(Kind):
    """Base of the sections that scale the two sides of a worm with half-rings."""

    registry: ClassVar[Registry[type[Any]]] = Registry("turning.kind", "annelid.control.turning")
    default: ClassVar[str] = "constant"

    def check_with(self, config: RunConfig) -> None:
        """Checks that the body has two sides."""
        if not config.body.has_halves:
            raise ValueError(
                f"turning.kind = {self.kind!r} needs a left and a right half of every ring: body.kind = 'worm' with "
                "body.rings.layout = 'halves'"
            )

    @property
    def goals(self) -> Goals:
        """The places on the ground that the worm is steered to."""
        return Goals()

    @abstractmethod
    def build(self, n_segments: int, control_timestep_s: float) -> Steering:
        """Builds the steering in its initial state.

        Args:
            n_segments: Segments of the worm.
            control_timestep_s: Control step, s.
        """


class OwnModel(NamedTuple):
    """A robot that a file describes whole.

    Attributes:
        xml: The robot and its ground as MJCF.
        actuators: Names of the actuators of its segments, segment by segment.
    """

    xml: str
    actuators: tuple[str, ...]


class BodyKind(Kind):
    """Base of the bodies' sections.

    Attributes:
        needs_arena: Whether it stands on an arena, the default one where none is given.
        is_planar: Whether it is a planar worm: rhombi in a row.
        has_skin: Whether the sides of its segments feel touch.
        touches_ground: Whether anything of the body bears on a ground or a wall.
        can_be_pushed: Whether a trial may push it.
        n_segments: Actuated segments.
    """

    registry: ClassVar[Registry[type[Any]]] = Registry("body.kind", "annelid.body.worm")
    default: ClassVar[str] = "worm"
    needs_arena: ClassVar[bool] = False
    is_planar: ClassVar[bool] = False
    has_skin: ClassVar[bool] = False
    touches_ground: ClassVar[bool] = True
    can_be_pushed: ClassVar[bool] = False

    def refuse_fidelity(self, level: str) -> None:
        """Refuses a level of fidelity (`annelid.config.fidelity`) where it was not measured.

        Raises:
            ConfigError: The levels are not for this body.
        """
        raise ConfigError(
            f"fidelity = {level!r} is for the 3D worm (body.kind = 'worm'), not for body.kind = {self.kind!r}"
        )

    @property
    def wall_distance_m(self) -> float | None:
        """Distance of the walls that a planar worm crawls between; None where there are none."""
        return None

    @property
    def own_model(self) -> OwnModel | None:
        """The model of a robot that a file describes whole; None where annelid builds it."""
        return None

    if TYPE_CHECKING:

        @property
        def n_segments(self) -> int:
            """A field of some bodies, and follows from other fields in others."""
            ...

    @property
    def has_halves(self) -> bool:
        """Whether each segment has a left and a right muscle."""
        return False

    @abstractmethod
    def build(self, config: RunConfig) -> Plant:
        """Builds the body at rest.

        Args:
            config: The configuration that the section is of.

        Raises:
            ConfigError: It cannot be built with these values.
        """


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
    # The families of the body's parts are defined beside them.
    BodyKind.registry.all()
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
