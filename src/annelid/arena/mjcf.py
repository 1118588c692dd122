"""What of MJCF, a scene or a whole robot, reaches the engine, which parses it: no file, no code, no endless amount.

A scene is static ground and movable things, a robot has actuators and sensors too. Either is one text without
references: what its file takes from other files is written into the text when it is read (`annelid.arena.mjcf_files`),
and whatever comes out of a configuration or a run file is checked again before the engine sees it (`checked`).
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from math import isfinite, prod

from annelid.errors import ConfigError, shown, suggest
from annelid.textfiles import line_of, parse_xml, tag_of

MOST_BYTES = 4_000_000
"""Of a text, with all that its file took from others."""
MOST_SAMPLES = 4_000_000
"""Of all height fields, textures and other grids of a text together."""
MOST_OBJECTS = 16
"""Things that move: the force of the worm on each is measured at every part of its skin."""
_LARGEST, _MOST_ITERATIONS = 1e6, 1e4
"""Of any number: beyond it nothing is a length, a mass or a stiffness in SI units. More iterations would take hours."""
_LARGEST_OF = {"young": 1e12, "shear": 1e12, "sdf_initpoints": _MOST_ITERATIONS}
_GRIDS = ("nrow", "ncol", "width", "height", "nchannel", "cellcount", "nsample", "actdim")
"""Attributes whose product is an amount of memory."""
_LOOKS = frozenset(["visual", "statistic", "size", "light", "camera", "custom"])
"""Elements that are left out: pictures have light and views of their own, and the engine finds the sizes itself."""
_REFUSED = {
    "include": "write its content into the file",
    "model": "write its content into the file",
    "attach": "write its content into the file",
    "extension": "plug-ins are code",
    "plugin": "plug-ins are code",
    "composite": "write its bodies out",
    "flexcomp": "write its bodies out",
    "replicate": "write out what it repeats",
}
"""Elements that no text can have, and what to do instead."""
_NEUROML = "this is a network of NeuroML; write it as TOML (annelid export-network PRESET --to toml shows the form)"
_FOREIGN = {
    "robot": "this is URDF; load it in MuJoCo and save it as MJCF, which begins with <mujoco>",
    "Lems": _NEUROML,
    "neuroml": _NEUROML,
}
"""Root elements of what is no MJCF, and what to do with it."""
_LENGTHRANGE = frozenset(["mode", "useexisting", "uselimit", "tolrange"])
_UNREAD = re.compile(r"[+-]?(0x[0-9a-f.]|nan\()", re.IGNORECASE)
"""Begins a number that the engine reads and Python does not, which would pass every limit."""


@dataclass(frozen=True)
class Rules:
    """What may be in a text, and how much of it.

    Attributes:
        what: What it is, in messages.
        most_elements: Of the text.
        most_levels: Of elements within one another.
        refused: Elements that it cannot have, and what to do instead.
        ignored: Elements that are left out.
        attributes: The only attributes of elements that may not have all.
    """

    what: str
    most_elements: int
    most_levels: int
    refused: Mapping[str, str]
    ignored: frozenset[str]
    attributes: Mapping[str, frozenset[str]] = field(default_factory=dict)


SCENE = Rules(
    "a scene",
    20_000,
    24,
    _REFUSED
    | {
        "option": "gravity and step are fields of the configuration (arena.gravity_m_per_s2, clock.physics_timestep_s)",
        "actuator": "nothing drives the things of a scene but the worm, gravity and springs",
        "sensor": "annelid records the things that move itself",
        "keyframe": "a scene starts as it is written",
        "tendon": "use the stiffness of joints",
        "equality": "use joints",
        "contact": "use contype and conaffinity",
        "deformable": "use bodies with joints",
    },
    _LOOKS,
    {"compiler": frozenset(["angle", "eulerseq", "autolimits"]), "lengthrange": frozenset()},
)
ROBOT = Rules(
    "a robot",
    20_000,
    200,
    _REFUSED,
    _LOOKS | {"keyframe"},
    {"lengthrange": _LENGTHRANGE},
)


def checked(text: str, rules: Rules = SCENE) -> str:
    """Checks a text and returns it as the engine gets it: elements and attributes alone, a scene's objects named.

    Raises:
        ConfigError: It is too long, no XML, or has an element, an attribute or an amount that it cannot have.
    """
    if len(text) > MOST_BYTES:
        raise ConfigError(f"is too long: {rules.what} has at most {MOST_BYTES / 1e6:g} MB of text, meshes included")
    return checked_tree(parsed(text, rules), rules)


def checked_tree(root: ET.Element, rules: Rules) -> str:
    """Does what `checked` does for a text that is `parsed`, whose errors name the lines of its file.

    Raises:
        ConfigError: It has an element, an attribute or an amount that it cannot have.
    """
    _leave_out(root, rules)
    grids = 0.0
    for element in root.iter():
        _check(element, rules)
        sizes = [abs(number) for name in _GRIDS for number in numbers_of(element, name)]
        grids += prod(sizes) if sizes else 0.0
    defaults = (one for one in root.iterfind(".//default/*") if one.tag != "tendon")  # whose width is a look
    if any(name in element.attrib for element in defaults for name in _GRIDS):
        raise ConfigError(f"<default>: must not have {', '.join(_GRIDS)}; write them where they hold")
    if grids > MOST_SAMPLES:
        raise ConfigError(f"has grids and textures of {grids:,.0f} samples: at most {MOST_SAMPLES:,} are read")
    if rules is SCENE:
        _name_objects(root)
    _break_lines(root, 1)
    return ET.tostring(root, encoding="unicode")


def _break_lines(parent: ET.Element, line: int) -> int:
    """Puts each element into the line of its file, which the engine's errors then name; returns the last one."""
    before = None
    for child in parent:
        gap = "\n" * max(line_of(child) - line, 0)
        if before is None:
            parent.text = gap
        else:
            before.tail = gap
        line, before = _break_lines(child, line + len(gap)), child
    return line


def parsed(text: str | bytes, rules: Rules, *, included: bool = False) -> ET.Element:
    """Returns the root of a text that is not checked yet; one that is included may begin with <mujocoinclude>.

    Raises:
        ConfigError: It is no XML, has a document type, too many or too deep elements, or another root.
    """
    root = parse_xml(text, rules.what, rules.most_elements, rules.most_levels)
    if root.tag != "mujoco" and not (included and root.tag == "mujocoinclude"):
        remedy = _FOREIGN.get(root.tag.rpartition("}")[2], "an MJCF file begins with <mujoco>")
        raise ConfigError(f"begins with <{shown(root.tag)[1:-1]}>: {remedy}")
    return root


def validator(rules: Rules) -> Callable[[str], str]:
    """Returns `checked` for a field of a configuration, which raises ValueError.

    Args:
        rules: What the text may contain.

    Raises:
        ValueError: By what is returned, where the text is refused.
    """

    def valid(text: str) -> str:
        try:
            return checked(text, rules)
        except ConfigError as error:
            raise ValueError(str(error)) from None

    return valid


def names_in(text: str, rules: Rules, path: str) -> tuple[str, ...]:
    """Returns the names of the elements at a path (``actuator/*``) of a text that is `checked`, in its order.

    Args:
        text: The text.
        rules: What it may contain.
        path: As in ElementTree.
    """
    return tuple(one.attrib["name"] for one in parsed(text, rules).iterfind(path) if "name" in one.attrib)


def with_attributes(text: str, rules: Rules, attributes: Mapping[str, Mapping[str, Mapping[str, float | str]]]) -> str:
    """Returns a text that is `checked` with other attributes of its elements, by tag, name and attribute.

    Args:
        text: The text.
        rules: What it may contain.
        attributes: The attributes.

    Raises:
        ConfigError: No element, or more than one, has such a tag and name, or the value is not allowed.
    """
    root = parsed(text, rules)
    for tag, elements in attributes.items():
        for name, values in elements.items():
            found = [one for one in root.iter(tag) if one.get("name") == name]
            if len(found) != 1:
                there = [one.attrib["name"] for one in root.iter(tag) if "name" in one.attrib]
                raise ConfigError(f"has {len(found)} <{tag}> named {shown(name)}: {suggest(name, there)}")
            found[0].attrib.update({attribute: str(value) for attribute, value in values.items()})
    return checked_tree(root, rules)


def stated_in(text: str, rules: Rules, section: str, name: str) -> str | None:
    """Returns what a text that is `checked` states last as an attribute of a section; None where it does not.

    Args:
        text: The text.
        rules: What it may contain.
        section: Name of the section.
        name: Name of the attribute.
    """
    return next(
        (one.attrib[name] for one in reversed(parsed(text, rules).findall(section)) if name in one.attrib), None
    )


def object_names(text: str) -> tuple[str, ...]:
    """Returns the names of the bodies that move in a scene that is `checked`, in its order."""
    return tuple(body.attrib["name"] for body in _movable(parsed(text, SCENE)))


def with_contact(text: str, contact: dict[str, str]) -> str:
    """Returns a scene whose geoms have these attributes unless they, or their defaults, state their own."""
    root = parsed(text, SCENE)
    top = root.find("default")
    if top is None:
        root.insert(0, top := ET.Element("default"))
    geom = top.find("geom")
    if geom is None:
        top.insert(0, geom := ET.Element("geom"))
    for name, value in contact.items():
        geom.attrib.setdefault(name, value)
    return ET.tostring(root, encoding="unicode")


def numbers_of(element: ET.Element, name: str) -> list[float]:
    """Returns the numbers among the words of an attribute.

    Raises:
        ConfigError: One is not written in decimals, not finite, or larger than any that is read.
    """
    largest = _MOST_ITERATIONS if name.endswith("iterations") else _LARGEST_OF.get(name, _LARGEST)
    numbers = []
    for word in element.get(name, "").split():
        if _UNREAD.match(word):
            raise ConfigError(f"{tag_of(element)} {name}={shown(element.get(name))}>: write {shown(word)} in decimals")
        try:
            numbers.append(float(word))
        except ValueError:
            continue
        if not isfinite(numbers[-1]) or abs(numbers[-1]) > largest:
            raise ConfigError(
                f"{tag_of(element)} {name}={shown(element.get(name))}>: numbers must be finite and at most {largest:g}"
            )
    return numbers


def _leave_out(root: ET.Element, rules: Rules) -> None:
    """Takes out what the engine needs not: looks, and sensors of a robot that nothing reads."""
    for parent in list(root.iter()):
        for child in list(parent):
            unread = parent.tag == "sensor" and child.tag not in ("tendonpos", "jointpos") and rules is ROBOT
            if child.tag in rules.ignored or unread:
                parent.remove(child)


def _check(element: ET.Element, rules: Rules) -> None:
    """Refuses an element for its name or for an attribute; what the engine does not know it refuses itself."""
    # What stands between the elements means nothing to the engine.
    element.text = element.tail = None
    if element.tag in rules.refused:
        raise ConfigError(f"{tag_of(element)}>: {rules.what} cannot have it; {rules.refused[element.tag]}")
    valid = rules.attributes.get(element.tag, element.attrib.keys())
    for name in element.attrib:
        if name.startswith("file") or (element.tag, name) == ("mesh", "builtin") or name not in valid:
            stated = f"{tag_of(element)} {shown(name)[1:-1]}={shown(element.get(name))}>"
            raise ConfigError(f"{stated}: {rules.what} cannot have this attribute")
        numbers_of(element, name)


def _name_objects(root: ET.Element) -> None:
    """Names the bodies that move and have no name.

    Raises:
        ConfigError: One moves without a joint of its own, or there are too many.
    """
    for world in root.iterfind("worldbody"):
        _check_motion(world, moving=False)
    objects = list(_movable(root))
    if len(objects) > MOST_OBJECTS:
        raise ConfigError(f"has {len(objects)} bodies that move: at most {MOST_OBJECTS} are measured")
    taken = {body.get("name") for body in objects}
    free = (name for number in range(1, 2 * MOST_OBJECTS + 1) if (name := f"object_{number}") not in taken)
    for body in objects:
        if "name" not in body.attrib:
            body.set("name", next(free))


def _check_motion(element: ET.Element, *, moving: bool) -> None:
    """Refuses bodies that move without a joint of their own, whose energy would count to no object."""
    for body in element.findall("body") + element.findall("frame"):
        jointed = _has_joint(body)
        if body.tag == "frame":
            if jointed:
                raise ConfigError("<frame> has a joint: write it into the body around it")
            jointed = moving
        elif moving and not jointed:
            raise ConfigError(
                f"<body name={shown(body.get('name', ''))}>: a body within one that moves needs a joint of its own; "
                "else write its geoms into the one around it"
            )
        _check_motion(body, moving=jointed)


def _has_joint(body: ET.Element) -> bool:
    return body.find("joint") is not None or body.find("freejoint") is not None


def _movable(root: ET.Element) -> Iterator[ET.Element]:
    return (body for body in root.iter("body") if _has_joint(body))
