"""Cables of MJCF that was written for MuJoCo up to version 3, as chains of bodies, which version 4 takes.

Those versions had a macro for a row of bodies (``<composite type="cable">``) and a plug-in that bends and twists it.
Here it becomes the same row: capsules between the vertices, each on three hinges whose springs are those of a round rod
of the plug-in's moduli E and G, E pi r^4 / (4 L) and G pi r^4 / (2 L), straight in the posture of the file.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from math import pi

import numpy as np

from annelid.errors import ConfigError, listed, shortened, shown
from annelid.protocols import Array
from annelid.textfiles import tag_of

PLUGIN = "mujoco.elasticity.cable"
MOST_VERTICES = 180
"""Of one cable, whose bodies lie within one another."""
TAKEN = {
    "composite": frozenset(["type", "prefix", "initial", "vertex", "offset", "curve", "count", "size"]),
    "joint": frozenset(["kind", "armature", "damping", "frictionloss"]),
    "plugin": frozenset(["plugin"]),
}
"""Attributes of a cable's elements that are understood; those of its geom are the capsules'."""
MATERIAL = {"bend", "twist", "vmax"}
"""What the plug-in may be told: two moduli, and one for colours."""


def write_out(root: ET.Element) -> None:
    """Replaces every cable of a model by its bodies, named ``<prefix>B_first``, ``B_1`` .. ``B_last`` as the macro did.

    Raises:
        ConfigError: A composite is no cable with vertices, or a number is missing or none.
    """
    for parent in list(root.iter()):
        for place, child in enumerate(list(parent)):
            if child.tag == "composite":
                parent.remove(child)
                parent.insert(place, _row(child))
    for extension in root.findall("extension"):
        if all(plugin.get("plugin") == PLUGIN for plugin in extension):
            root.remove(extension)


def _row(cable: ET.Element) -> ET.Element:
    prefix, initial, about = cable.get("prefix", ""), cable.get("initial", "none"), f"{tag_of(cable)}>"
    if cable.get("type") != "cable" or initial not in ("none", "ball", "free"):
        raise ConfigError(
            f"{about}: only a cable can be read, type='cable' with initial='none', 'ball' or 'free'; write other "
            "composites out as bodies"
        )
    for element in cable.iter():
        if unknown := element.attrib.keys() - TAKEN.get(element.tag, element.attrib.keys()):
            name, valid = sorted(unknown)[0], listed(sorted(TAKEN[element.tag]))
            raise ConfigError(
                f"{tag_of(element)} {shortened(name)}=..>: a cable cannot have this attribute; valid: {valid}"
            )
    if any(plugin.get("plugin") != PLUGIN for plugin in cable.iterfind("plugin")):
        raise ConfigError(f"{about}: the one plug-in of a cable is {PLUGIN}; others are code")
    vertices = _vertices(cable)
    joint, geom = (_only(cable, tag) for tag in ("joint", "geom"))
    config = {one.get("key", ""): one for one in cable.iterfind("plugin/config")}
    if other := {key for key, one in config.items() if one.get("value") != "false"} - MATERIAL:
        raise ConfigError(
            f"{tag_of(config[min(other)])} key={shown(min(other))}>: a cable cannot have it; valid: "
            f"{listed(sorted(MATERIAL))}. A cable is at rest as the file shows it: write a flat one's places straight"
        )
    bend_Pa, twist_Pa = (_numbers(config[key], "value", "0")[0] if key in config else 0.0 for key in ("bend", "twist"))
    if (section := geom.get("type", "capsule")) not in ("capsule", "cylinder"):
        raise ConfigError(
            f"{tag_of(geom)} type={shown(section)}>: a cable has capsules or cylinders, for their stiffness"
        )
    radius_m = _numbers(geom, "size", "0.005")[0]
    look = {name: value for name, value in geom.attrib.items() if name not in ("type", "size")}
    friction = {name: value for name, value in joint.attrib.items() if name != "kind"}
    offset = np.array(_numbers(cable, "offset", "0 0 0"))
    edges = np.diff(vertices, axis=0)
    if offset.shape != (3,) or not np.linalg.norm(edges, axis=1).all():
        raise ConfigError(f"{about}: offset must be three numbers, and no two vertices alike")
    places = [vertices[0] + offset, *edges[:-1]]
    first = element = None
    for number, (place, edge) in enumerate(zip(places, edges, strict=True)):
        name = "B_first" if number == 0 else "B_last" if number == len(edges) - 1 else f"B_{number}"
        body = ET.Element("body", {"name": f"{prefix}{name}", "pos": _text(place)})
        if element is None:
            first = body
            if initial == "free":
                ET.SubElement(body, "freejoint")
            elif initial == "ball":
                ET.SubElement(body, "joint", {"type": "ball", **friction})
            ET.SubElement(body, "site", {"name": f"{prefix}S_first"})
        else:
            element.append(body)
            length_m = float(np.linalg.norm(edge))
            bend, twist = bend_Pa * pi * radius_m**4 / 4 / length_m, twist_Pa * pi * radius_m**4 / 2 / length_m
            for axis, spring in zip(_axes(edge / length_m), (twist, bend, bend), strict=True):
                hinge = {"type": "hinge", "axis": _text(axis), "stiffness": f"{spring:.9g}"}
                ET.SubElement(body, "joint", {**hinge, **friction})
        shape = {"type": section, "fromto": f"0 0 0 {_text(edge)}", "size": f"{radius_m:g}"}
        ET.SubElement(body, "geom", {**look, **shape, "name": f"{prefix}G{number}"})
        element = body
    assert first is not None
    assert element is not None
    ET.SubElement(element, "site", {"name": f"{prefix}S_last", "pos": _text(edges[-1])})
    return first


def _vertices(cable: ET.Element) -> Array:
    """The places of a cable's vertices, as written or on a curve, ``(n, 3)``.

    Along a curve, s goes to the first size. ``cos(s)`` and ``sin(s)`` have the second as amplitude, and go through the
    third half turns.
    """
    about = f"{tag_of(cable)}>"
    if cable.get("vertex"):
        given = np.array(_numbers(cable, "vertex", ""))
        if len(given) % 3 or not 9 <= len(given) <= 3 * MOST_VERTICES:
            raise ConfigError(f"{about}: vertex must have three numbers of each of 3 to {MOST_VERTICES:,} places")
        return given.reshape(-1, 3)
    count, *across = _numbers(cable, "count", "0")
    words = cable.get("curve", "").split()
    if not (count.is_integer() and 3 <= count <= MOST_VERTICES) or any(one != 1 for one in across):
        raise ConfigError(f"{about}: needs vertex=.., or curve=.. and count='N 1 1' with 3 to {MOST_VERTICES:,} places")
    share, size = np.linspace(0.0, 1.0, int(count)), [*_numbers(cable, "size", "1"), 0.0, 0.0]
    turn = pi * size[2] * share
    curves = {
        "s": size[0] * share,
        "cos(s)": size[1] * np.cos(turn),
        "sin(s)": size[1] * np.sin(turn),
        "0": 0.0 * share,
    }
    if not 1 <= len(words) <= 3 or not curves.keys() >= set(words):
        raise ConfigError(f"{about}: curve={shown(cable.get('curve'))}: must be up to three of {listed(list(curves))}")
    return np.stack([curves[word] for word in [*words, "0", "0"][:3]], axis=1)


def _numbers(element: ET.Element, name: str, default: str) -> list[float]:
    try:
        numbers = [float(word) for word in element.get(name, default).split()]
    except ValueError:
        numbers = []
    if not numbers or not np.isfinite(numbers).all():
        raise ConfigError(f"{tag_of(element)} {name}={shown(element.get(name))}>: must be numbers")
    return numbers


def _only(cable: ET.Element, tag: str) -> ET.Element:
    found = cable.findall(tag)
    return found[0] if found else ET.Element(tag)


def _axes(along: Array) -> tuple[Array, Array, Array]:
    """A unit vector and two across it, all at right angles."""
    least = np.eye(3)[np.argmin(np.abs(along))]
    across = least - along * (along @ least)
    across /= np.linalg.norm(across)
    x, y = along, across
    return along, across, np.array([x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]])


def _text(numbers: Array) -> str:
    return " ".join(f"{number:.9g}" for number in numbers)
