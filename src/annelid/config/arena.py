"""The 3D worm's ground: what all kinds of it have."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple

from pydantic import Field

from annelid.config.kinds import Kind
from annelid.config.sections import Impedance, NonNegative, Positive
from annelid.registry import Registry

if TYPE_CHECKING:
    import mujoco

    from annelid.arena.course import Bore, Course
    from annelid.arena.surface import Shape, Surface

Friction = Annotated[float, Field(ge=0.01, le=100)]
Place = Annotated[float, Field(ge=-1e4, le=1e4)]
Post = tuple[Place, Place, Annotated[float, Field(gt=0, le=100)]]
"""Of an upright round post: x, y and radius, m."""


class Walls(NamedTuple):
    """What stands upright on a ground.

    Attributes:
        rail_gap_m: Distance of two guard rails along x, the worm midway, m; None for none.
        posts: x, y and radius of upright round posts, m.
    """

    rail_gap_m: float | None = None
    posts: tuple[Post, ...] = ()


class ArenaKind(Kind):
    """Base of the arenas' sections: the fields of every ground, and what the body, the pictures and the tasks ask it.

    Attributes:
        is_closed: Whether its walls surround the worm; they are drawn so that one sees through them.
        is_scene: Whether all that the skin touches comes from `add_own`, as geoms that the engine collides with it.
    """

    registry: ClassVar[Registry[type[Any]]] = Registry("arena.kind", "annelid.arena.kinds")
    default: ClassVar[str] = "floor"
    is_closed: ClassVar[bool] = False
    is_scene: ClassVar[bool] = False

    friction: Friction = Field(default=1.0, description="coefficient of sliding friction")
    backward_friction: Friction | None = Field(
        default=None, description="the same where the skin slides towards the worm's rear, as setae do (not set: alike)"
    )
    gravity_m_per_s2: NonNegative = Field(default=9.81, description="0 for a weightless worm")
    contact_time_constant_s: Positive = Field(default=0.02, description="solref time constant of the contacts")
    contact_impedance: Impedance = Field(
        default=(0.9, 0.95, 0.001), description="solimp (d0, dwidth, width) of the contacts"
    )

    @property
    def has_setae(self) -> bool:
        """Whether friction depends on the direction in which the skin slides."""
        return self.backward_friction not in (None, self.friction)

    @property
    def has_moving_planes(self) -> bool:
        """Whether the skin feels the ground through planes that move with it, not through a plane of the engine."""
        return not self.is_plane or self.has_setae

    @property
    def is_plane(self) -> bool:
        """Whether its ground is one plane."""
        return False

    @property
    def walls(self) -> Walls:
        """What stands upright on it."""
        return Walls()

    @property
    def slope_rad(self) -> float:
        """How steeply the model's axes rise towards -x, rad."""
        return 0.0

    @property
    @abstractmethod
    def floor_depth_m(self) -> float:
        """How far the floor that is drawn lies below the mesh's lowest line at the start, m."""

    @abstractmethod
    def ground(self) -> Surface:
        """Returns its surface without what stands upright on it, in the coordinates of the worm's model."""

    def centre_line(self) -> Course | None:
        """Returns the centre line of a pipe, None where there is none."""
        return None

    def bore(self) -> Bore | None:
        """Returns the radius along the centre line, None where there is none."""
        return None

    def reach_m(self) -> tuple[float, float] | None:
        """Returns the arc lengths of a pipe between which it bends or changes its bore, None where there is no pipe."""
        return None

    def shape(self, length_m: float) -> Shape | None:
        """Returns the shape of its ground to be drawn, None where a plane is.

        Args:
            length_m: Length of the worm, which stands or lies in it.
        """
        return None

    @property
    def object_names(self) -> tuple[str, ...]:
        """Names of the things that move in it, in the order of the model."""
        return ()

    def add_own(self, spec: mujoco.MjSpec) -> None:
        """Adds what it has beyond its surface to a worm's spec: nothing unless `is_scene`."""

    def add_panels(self, spec: mujoco.MjSpec, length_m: float) -> None:
        """Adds geoms that hold a worm in plain MuJoCo where the ground is not one plane; they are not drawn.

        Args:
            spec: The worm's spec.
            length_m: Length of the worm.
        """


SHARED = tuple(name for name in ArenaKind.model_fields if name != "kind")
"""Fields of every arena; a worm that is put elsewhere keeps those that the place does not state."""
