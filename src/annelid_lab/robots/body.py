"""A robot of one's own: a body that an MJCF file describes whole, driven and sensed by the names in it."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from importlib import import_module
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from annelid.arena import ROBOT, names_in, read_mjcf, stated_in, validator, with_attributes
from annelid.config import BodyKind, Line, OwnModel
from annelid.errors import ConfigError, listed, shown
from annelid.textfiles import toml_value
from annelid_lab.robots.cables import write_out

if TYPE_CHECKING:
    from annelid.config import RunConfig
    from annelid.protocols import Plant

EXAMPLE = """<mujoco><compiler autolimits="true"/><worldbody><geom name="floor" type="plane" size="5 5 1"/>
<body name="head" pos="0 0 0.05"><freejoint/><geom size="0.03" mass="0.2"/>
<body pos="0.1 0 0"><joint name="s1" type="slide" axis="1 0 0" range="-0.04 0.04"/><geom size="0.03" mass="0.2"/>
<body pos="0.1 0 0"><joint name="s2" type="slide" axis="1 0 0" range="-0.04 0.04"/><geom size="0.03" mass="0.2"/>
<body pos="0.1 0 0"><joint name="s3" type="slide" axis="1 0 0" range="-0.04 0.04"/><geom size="0.03" mass="0.2"/>
</body></body></body></body></worldbody><actuator>
<position name="ring_1" joint="s1" kp="200" kv="20" ctrlrange="-0.03 0.03"/>
<position name="ring_2" joint="s2" kp="200" kv="20" ctrlrange="-0.03 0.03"/>
<position name="ring_3" joint="s3" kp="200" kv="20" ctrlrange="-0.03 0.03"/></actuator><sensor>
<jointpos name="stretch_1" joint="s1"/><jointpos name="stretch_2" joint="s2"/><jointpos name="stretch_3" joint="s3"/>
</sensor></mujoco>"""
"""Four balls on a floor and three motors that draw each to the one before it."""
PLACE = "{segment}"
_JOINTS = "worldbody//joint"
_DRIVEN = ("joint", "jointinparent", "tendon", "site", "cranksite")


def _pattern(text: str) -> str:
    if text.count(PLACE) != 1:
        raise ValueError(f"{shown(text)}: must have {PLACE} once, where the number of the segment stands")
    return text


Pattern = Annotated[Line, Field(max_length=100), AfterValidator(_pattern)]


def _completed(root: ET.Element) -> None:
    """Writes out cables, and names an actuator without a name by the joint, tendon or site that it drives."""
    write_out(root)
    actuators = root.findall("actuator/*")
    taken = {one.get("name") for one in actuators}
    for one in actuators:
        driven = next((one.attrib[key] for key in _DRIVEN if key in one.attrib), None)
        if "name" not in one.attrib and driven is not None and driven not in taken:
            one.set("name", driven)
            taken.add(driven)


class MjcfBody(BodyKind):
    """A robot that an MJCF file describes whole, with its ground.

    Each segment has an actuator, or a left and a right one, and a stretch sensor or several; their names follow
    patterns. The text refers to no file: what the file has from others, `from_file` has written into it.
    """

    suffix: ClassVar[str] = ".xml"
    kind: Literal["mjcf"] = "mjcf"
    xml: Annotated[str, AfterValidator(validator(ROBOT))] = Field(
        default=EXAMPLE, description="the robot and its ground as MJCF, at most 4 MB; annelid run robot.xml reads one"
    )
    actuators: Annotated[tuple[Pattern, ...], Field(min_length=1, max_length=2)] = Field(
        default=("ring_{segment}",),
        description="name of a segment's actuator, or of its left and its right one, with {segment} for its number",
    )
    sensors: Annotated[tuple[Pattern, ...], Field(min_length=1, max_length=200)] = Field(
        default=("stretch_{segment}",),
        description="names of a segment's stretch sensors: tendons, joints, or sensors of their lengths",
    )
    first_segment: Annotated[int, Field(ge=0, le=1)] = Field(
        default=1, description="number of the foremost segment in the names"
    )

    attributes: Mapping[Line, Mapping[Line, Mapping[Line, float | Line]]] = Field(
        default={},
        description="other values of the file's attributes, by tag, name and attribute, as joint.tail.damping = 2",
    )

    @classmethod
    def from_file(cls, path: Path) -> dict[str, Any]:
        """Reads an MJCF file and the meshes that it names beside it, and the physics step that it states.

        Raises:
            ConfigError: The file cannot be read, or has what a robot cannot have.
        """
        xml = read_mjcf(path, ROBOT, _completed)
        step_s = stated_in(xml, ROBOT, "option", "timestep")
        clock = {} if step_s is None else {"clock": {"physics_timestep_s": step_s}}
        return {"body": {"kind": "mjcf", "xml": xml}, **clock}

    @property
    def n_segments(self) -> int:
        """Segments that have all their actuators, counted from the first one on."""
        there = set(names_in(self.xml, ROBOT, "actuator/*"))
        return next(n for n in count() if not there.issuperset(self._named(self.actuators, n)))

    @property
    def has_halves(self) -> bool:
        """Whether each segment has a left and a right actuator."""
        return len(self.actuators) == 2

    @property
    def own_model(self) -> OwnModel:
        """The file with the attributes of this section, and the names of the actuators of all segments."""
        names = (name for n in range(self.n_segments) for name in self._named(self.actuators, n))
        return OwnModel(with_attributes(self.xml, ROBOT, self.attributes), tuple(names))

    @property
    def sensor_names(self) -> list[list[str]]:
        """Names of the stretch sensors of each segment."""
        return [self._named(self.sensors, n) for n in range(self.n_segments)]

    @model_validator(mode="after")
    def _has_segments(self) -> Self:
        if not self.n_segments:
            wanted = listed(self._named(self.actuators, 0))
            there = names_in(self.xml, ROBOT, "actuator/*")
            pattern = re.sub(r"\d+", PLACE, there[0], count=1) if there else ""
            remedy = (
                f"write actuators = [{toml_value(pattern)}] under [body]"
                if PLACE in pattern
                else (
                    "name them by numbers"
                    if there
                    else "without any it can be an arena (annelid run PRESET --arena FILE)"
                )
            )
            raise ValueError(
                f"body.actuators: the file has no actuator named {wanted}; it has {listed(there) or 'none'}: {remedy}"
            )
        known = {name for path in ("tendon/*", "sensor/*", _JOINTS) for name in names_in(self.xml, ROBOT, path)}
        for name in (name for names in self.sensor_names for name in names):
            if name not in known:
                pattern = next(
                    (re.sub(r"\d+", PLACE, one, count=1) for one in sorted(known) if re.search(r"\d", one)), ""
                )
                remedy = f": write sensors = [{toml_value(pattern)}] under [body]" if pattern else ""
                raise ValueError(
                    f"body.sensors: the file has no tendon, joint or sensor named {name!r}; it has "
                    f"{listed(sorted(known)) or 'none'}{remedy}"
                )
        try:
            _ = self.own_model
        except ConfigError as error:
            raise ValueError(f"body.attributes: the file {error}") from None
        return self

    def check_with(self, config: RunConfig) -> None:
        """Checks that the arena, if there is one, is a scene at rest."""
        arena = config.arena
        if arena is not None and (not arena.is_scene or arena.object_names):
            kind = "things that move" if arena.is_scene else f"arena.kind = {arena.kind!r}"
            raise ValueError(
                f"{kind} cannot be beside body.kind = 'mjcf', whose file has its own ground: --arena takes a scene as "
                "MJCF without joints"
            )

    def build(self, config: RunConfig) -> Plant:
        """Builds the robot, as `BodyKind.build`."""
        return import_module("annelid_lab.robots.plant").MjcfPlant(self, config)

    def _named(self, patterns: tuple[str, ...], n: int) -> list[str]:
        return [pattern.replace(PLACE, str(self.first_segment + n)) for pattern in patterns]
