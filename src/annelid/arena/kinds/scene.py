"""A scene: ground and movable things of an MJCF file, as the engine collides them with the skin."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, Field

from annelid.arena.centre_line import UP
from annelid.arena.mjcf import SCENE, object_names, validator, with_contact
from annelid.arena.mjcf_files import read_mjcf
from annelid.arena.surface import Plane, Surface
from annelid.config.run import ArenaKind, RunConfig
from annelid.config.sections import NonNegative

if TYPE_CHECKING:
    import mujoco


FLOOR = '<mujoco><worldbody><geom name="floor" type="plane" size="5 5 1" /></worldbody></mujoco>'


class Scene(ArenaKind):
    """Ground and movable things of an MJCF file.

    The text is the whole scene: it refers to no file. What the file has from others, `from_file` has written into it.
    """

    kind: Literal["scene"] = "scene"
    suffix: ClassVar[str] = ".xml"
    is_scene: ClassVar[bool] = True
    xml: Annotated[str, AfterValidator(validator(SCENE))] = Field(
        default=FLOOR, description="the scene as MJCF without files, at most 4 MB; --arena scene.xml reads one"
    )
    floor_gap_m: NonNegative = Field(
        default=0.009, description="distance of the scene's z = 0 below the mesh's lowest line"
    )

    @classmethod
    def from_file(cls, path: Path) -> dict[str, Any]:
        """Reads a scene and the files that it names beside it."""
        return {"arena": {"kind": "scene", "xml": read_mjcf(path)}}

    @property
    def has_moving_planes(self) -> bool:
        """False: the engine finds what of the scene the skin touches."""
        return False

    @property
    def floor_depth_m(self) -> float:
        """As `floor_gap_m`."""
        return self.floor_gap_m

    @property
    def object_names(self) -> tuple[str, ...]:
        """Names of the bodies that move."""
        return object_names(self.xml)

    def ground(self) -> Surface:
        """Returns the plane z = 0 of the scene, from which heights are measured; the engine knows what is touched."""
        return Plane(UP, -self.floor_gap_m)

    def check_with(self, config: RunConfig) -> None:
        """Checks that friction is the same in every direction.

        Raises:
            ValueError: It is not.
        """
        if self.has_setae:
            raise ValueError(
                f"arena.backward_friction = {self.backward_friction:g}: must be left out with arena.kind = 'scene', "
                "whose friction the engine has, the same in every direction"
            )

    def add_own(self, spec: mujoco.MjSpec) -> None:
        """Adds ground and things, which have the arena's contact parameters unless they state their own."""
        from annelid.arena.friction import contact_options
        from annelid.arena.geoms import add_scene

        options = contact_options(self)
        contact = {name: " ".join(map(repr, options[name])) for name in ("friction", "solref", "solimp")}
        add_scene(spec, with_contact(self.xml, contact), self.floor_gap_m)
