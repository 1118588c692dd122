"""Reads MJCF, a scene or a whole robot, as data: what may be in it is listed in `annelid.arena.grammar`.

A scene is static ground and movable things, a robot has actuators and sensors too. Either is one text without
references: what its file takes from other files is written into the text when it is read (`read_mjcf`), and whatever
comes out of a configuration or a run file is checked again before the engine sees it (`checked`). The engine parses no
text that has not passed, and opens no file.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from io import BytesIO
from itertools import pairwise
from math import isfinite
from pathlib import Path, PurePosixPath

import numpy as np
from numpy.typing import NDArray

from annelid.arena.cables import write_out
from annelid.arena.grammar import (
    CHOICES,
    INSTEAD,
    LARGEST,
    LARGEST_OF,
    MOST_BYTES,
    MOST_FILE_BYTES,
    MOST_OBJECTS,
    MOST_PIXELS,
    MOST_SAMPLES,
    MOST_VERTICES,
    NAMES,
    ROBOT,
    SCENE,
    SINGLE,
    WITHIN,
    Grammar,
)
from annelid.errors import ConfigError, listed, shortened, shown
from annelid.protocols import Array
from annelid.text import is_line
from annelid.textfiles import parse_xml, read_bytes

_FILES = {"mesh": ("file", (".obj", ".stl")), "hfield": ("file", (".png",))}
_FOLDERS = ("meshdir", "assetdir")


def read_mjcf(path: Path, grammar: Grammar = SCENE) -> str:
    """Reads an MJCF file and the files that it names, beside it or below its folder, as one text without references.

    Args:
        path: The file.
        grammar: What it may contain.

    Raises:
        ConfigError: A file cannot be read, lies elsewhere or is too large, or the text is not what `checked` allows.
    """
    content = read_bytes(path, f"the file of {grammar.what}", MOST_BYTES)
    try:
        root = _parsed(content, grammar)
        folder = _take_folder(root)
        if grammar is ROBOT:
            write_out(root, _given)
        _leave_out(root, grammar)
        for element in root.iterfind("asset/*"):
            if element.tag in _FILES and "file" in element.attrib:
                _write_in(element, path.parent, folder)
        return checked(ET.tostring(root, encoding="unicode"), grammar)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None


def checked(text: str, grammar: Grammar = SCENE) -> str:
    """Checks a text and returns it as the engine gets it: elements and attributes alone, a scene's objects named.

    Raises:
        ConfigError: It is too long, no XML, or has an element, an attribute or a value that it cannot have.
    """
    if len(text) > MOST_BYTES:
        raise ConfigError(f"is too long: {grammar.what} has at most {MOST_BYTES / 1e6:g} MB of text, meshes included")
    root = _parsed(text, grammar)
    if root.tag != "mujoco":
        raise ConfigError(f"begins with <{shortened(root.tag)}>: an MJCF file begins with <mujoco>")
    _check(root, grammar)
    _check_sizes(root)
    if grammar is not SCENE:
        return ET.tostring(root, encoding="unicode")
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
    return ET.tostring(root, encoding="unicode")


def validator(grammar: Grammar) -> Callable[[str], str]:
    """Returns `checked` for a field of a configuration, which raises ValueError.

    Args:
        grammar: What the text may contain.

    Raises:
        ValueError: By what is returned, where the text is refused.
    """

    def valid(text: str) -> str:
        try:
            return checked(text, grammar)
        except ConfigError as error:
            raise ValueError(str(error)) from None

    return valid


def names_in(text: str, grammar: Grammar, section: str) -> tuple[str, ...]:
    """Returns the names of the elements of a section (``actuator``) of a text that is `checked`, in its order.

    Args:
        text: The text.
        grammar: What it may contain.
        section: Name of the section.
    """
    root = _parsed(text, grammar)
    return tuple(element.attrib["name"] for element in root.iterfind(f"{section}/*") if "name" in element.attrib)


def stated_in(text: str, grammar: Grammar, section: str, name: str) -> str | None:
    """Returns what a text that is `checked` states last as an attribute of a section; None where it does not.

    Args:
        text: The text.
        grammar: What it may contain.
        section: Name of the section.
        name: Name of the attribute.
    """
    return next(
        (one.attrib[name] for one in reversed(_parsed(text, grammar).findall(section)) if name in one.attrib), None
    )


def object_names(text: str) -> tuple[str, ...]:
    """Returns the names of the bodies that move in a scene that is `checked`, in its order."""
    return tuple(body.attrib["name"] for body in _movable(_parsed(text)))


def with_contact(text: str, contact: dict[str, str]) -> str:
    """Returns a scene whose geoms have these attributes unless they, or their defaults, state their own."""
    root = _parsed(text)
    top = root.find("default")
    if top is None:
        root.insert(0, top := ET.Element("default"))
    geom = top.find("geom")
    if geom is None:
        top.insert(0, geom := ET.Element("geom"))
    for name, value in contact.items():
        geom.attrib.setdefault(name, value)
    return ET.tostring(root, encoding="unicode")


def _parsed(text: str | bytes, grammar: Grammar = SCENE) -> ET.Element:
    return parse_xml(text, grammar.what, grammar.most_elements, grammar.most_levels)


def _leave_out(root: ET.Element, grammar: Grammar) -> None:
    """Takes out what the engine needs not: looks, and sensors that nothing reads."""
    for parent in list(root.iter()):
        unread = grammar is ROBOT and parent.tag == "sensor"
        for child in list(parent):
            if child.tag in grammar.ignored or (unread and child.tag not in grammar.allowed["sensor"][0].split()):
                parent.remove(child)


def _check(element: ET.Element, grammar: Grammar, above: tuple[str, ...] = ()) -> None:
    here = (*above, element.tag)
    within = next((names for end, names in WITHIN.items() if grammar is ROBOT and here[-len(end) :] == end), None)
    inner, attributes = ("", within) if within is not None else grammar.allowed[element.tag]
    for name, value in element.attrib.items():
        if name not in attributes.split():
            raise ConfigError(
                f"<{element.tag} {shortened(name)}=..>: {grammar.what} cannot have this attribute; valid: "
                f"{listed(sorted(attributes.split())) or 'none'}"
            )
        _check_value(element.tag, name, value, grammar)
    # What stands between the elements means nothing to the engine.
    element.text = element.tail = None
    for child in element:
        if child.tag not in inner.split():
            instead = f"; {INSTEAD[child.tag]}" if child.tag in INSTEAD and child.tag not in grammar.allowed else ""
            raise ConfigError(
                f"<{element.tag}> has <{shortened(child.tag)}>, which {grammar.what} cannot have{instead}. Valid "
                f"there: {listed(sorted(inner.split())) or 'nothing'}"
            )
        _check(child, grammar, here)


def _check_value(tag: str, name: str, value: str, grammar: Grammar) -> None:
    if name in NAMES or name == "body":
        # A flex names the body of each of its vertices.
        if any(
            not is_line(one) or len(one) > 100 or "/" in one for one in (value.split() if name == "body" else [value])
        ):
            raise ConfigError(f"<{tag} {name}={shown(value)}>: must be at most 100 printable characters without '/'")
    elif name in CHOICES or (tag, name) == ("flag", "gravity"):
        if not value.isalnum() or len(value) > 20 or value == "sdf":
            raise ConfigError(f"<{tag} {name}={shown(value)}>: {grammar.what} cannot have this value")
    else:
        largest = LARGEST_OF.get(name, LARGEST)
        numbers = _numbers(value, largest)
        if numbers is None or not len(numbers) or (len(numbers) > 1 and name in SINGLE):
            wanted = "one number" if name in SINGLE else "numbers"
            raise ConfigError(f"<{tag} {name}={shown(value)}>: must be {wanted} of at most {largest:g}")


def _numbers(value: str, largest: float = LARGEST) -> list[float] | None:
    """Returns the numbers of an attribute, None where it has anything else."""
    try:
        numbers = [float(word) for word in value.split()]
    except ValueError:
        return None
    # Python also reads 1_000 and digits of other scripts, the engine does not.
    plain = value.isascii() and "_" not in value
    return numbers if plain and all(isfinite(number) and abs(number) <= largest for number in numbers) else None


def _given(element: ET.Element, name: str, default: str) -> list[float]:
    """Returns the numbers of an attribute that is read here and not by the engine."""
    value = element.get(name, default)
    numbers = _numbers(value, LARGEST_OF.get(name, LARGEST))
    if not numbers:
        raise ConfigError(f"<{element.tag} {name}={shown(value)}>: must be numbers")
    return numbers


def _check_sizes(root: ET.Element) -> None:
    vertices = sum(len(mesh.get("vertex", "").split()) // 3 for mesh in root.iter("mesh"))
    if vertices > MOST_VERTICES:
        raise ConfigError(f"has meshes of {vertices:,} vertices: at most {MOST_VERTICES:,} are read, so thin them out")
    samples = 0.0
    for field in root.iter("hfield"):
        rows, columns = (float(field.get(name, "0")) for name in ("nrow", "ncol"))
        if not (rows >= 2 and columns >= 2 and rows * columns == len(field.get("elevation", "").split())):
            raise ConfigError(
                f"<hfield name={shown(field.get('name', ''))}>: needs nrow and ncol of at least 2 and as many numbers "
                "in elevation, or a picture as its file"
            )
        samples += rows * columns
    if samples > MOST_SAMPLES:
        raise ConfigError(f"has height fields of {samples:,.0f} samples: at most {MOST_SAMPLES:,} are read")
    pixels = 0.0
    for texture in root.iter("texture"):
        if not texture.get("builtin"):
            raise ConfigError(f"<texture name={shown(texture.get('name', ''))}>: needs builtin; pictures are not read")
        sides = [float(texture.get(side, "1")) for side in ("width", "height")]
        if not all(1 <= side <= MOST_PIXELS for side in sides):
            raise ConfigError(
                f"<texture width=.. height=..>: must be in 1 .. {MOST_PIXELS}, not {sides[0]:g}, {sides[1]:g}"
            )
        pixels += sides[0] * sides[1]
    if pixels > MOST_PIXELS**2:
        raise ConfigError(f"has textures of {pixels:,.0f} pixels: at most {MOST_PIXELS**2:,} are drawn")


def _check_motion(element: ET.Element, *, moving: bool) -> None:
    """Refuses bodies that move without a joint of their own, whose energy would count to no object."""
    for body in element.findall("body") + element.findall("frame"):
        if body.tag == "frame":
            _check_motion(body, moving=moving)
            continue
        jointed = _has_joint(body)
        if moving and not jointed:
            raise ConfigError(
                f"<body name={shown(body.get('name', ''))}>: a body within one that moves needs a joint of its own; "
                "else write its geoms into the one around it"
            )
        _check_motion(body, moving=jointed)


def _has_joint(body: ET.Element) -> bool:
    return body.find("joint") is not None or body.find("freejoint") is not None


def _movable(root: ET.Element) -> Iterator[ET.Element]:
    return (body for body in root.iter("body") if _has_joint(body))


def _take_folder(root: ET.Element) -> PurePosixPath:
    """Takes the folder of meshes out of a scene: beside the file where none is named."""
    folder = PurePosixPath()
    for compiler in root.iterfind("compiler"):
        for name in reversed(_FOLDERS):
            folder = PurePosixPath(compiler.attrib.pop(name, str(folder)))
    return folder


def _write_in(element: ET.Element, beside: Path, folder: PurePosixPath) -> None:
    """Writes what an element takes from a file into its attributes."""
    attribute, suffixes = _FILES[element.tag]
    given = element.attrib.pop(attribute)
    path = _inside(beside, folder, given, suffixes)
    element.attrib.setdefault("name", path.stem)
    content = read_bytes(path, "the file of the scene", MOST_FILE_BYTES)
    if element.tag == "hfield":
        rows = _pixels(content, path)
        element.attrib |= {"nrow": str(rows.shape[0]), "ncol": str(rows.shape[1])}
        element.set("elevation", " ".join(map(str, rows.ravel().tolist())))
        return
    vertices, faces = _stl(content, path) if path.suffix.lower() == ".stl" else _obj(content, path)
    if len(vertices) > MOST_VERTICES:
        raise ConfigError(f"{path} has {len(vertices):,} vertices: at most {MOST_VERTICES:,} are read, so thin it out")
    element.set("vertex", " ".join(f"{number:.7g}" for number in vertices.ravel().tolist()))
    element.set("face", " ".join(map(str, faces.ravel().tolist())))


def _inside(beside: Path, folder: PurePosixPath, given: str, suffixes: tuple[str, ...]) -> Path:
    """Returns the path of a file that lies beside the scene's or below it, wherever links lead."""
    name = folder / given
    refused = f"file={shown(given)}: must be a relative path below the folder of the scene"
    if not is_line(str(name)) or name.is_absolute() or ".." in name.parts or "\\" in str(name) or ":" in str(name):
        raise ConfigError(f"{refused}, with '/' and without '..'")
    if name.suffix.lower() not in suffixes:
        raise ConfigError(f"file={shown(given)}: must end in {' or '.join(suffixes)}")
    path = beside / name
    try:
        inside = path.resolve().is_relative_to(beside.resolve())
    except (OSError, RuntimeError) as error:
        raise ConfigError(f"{refused}: {error}") from None
    if not inside:
        raise ConfigError(f"{refused}; a link leads out of it")
    return path


def _obj(content: bytes, path: Path) -> tuple[Array, NDArray[np.int64]]:
    """Reads vertices and triangles of a Wavefront file; faces of more corners become fans."""
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    try:
        for line in content.decode("utf-8-sig").splitlines():
            word, *rest = line.split() or [""]
            if word == "v":
                vertices.append([float(number) for number in rest[:3]])
            elif word == "f":
                corners = [int(corner.split("/")[0]) for corner in rest]
                # Negative ones count back from the vertex that was given last.
                corners = [corner - 1 if corner > 0 else len(vertices) + corner for corner in corners]
                faces += [[corners[0], *pair] for pair in pairwise(corners[1:])]
        points, triangles = np.array(vertices, dtype=float), np.array(faces, dtype=np.int64)
    except (ValueError, IndexError, OverflowError) as error:
        raise ConfigError(f"{path} is no Wavefront file of vertices and faces: {shortened(str(error))}") from None
    return _mesh(points, triangles, path)


def _stl(content: bytes, path: Path) -> tuple[Array, NDArray[np.int64]]:
    """Reads vertices and triangles of a binary STL file; corners at one place become one vertex."""
    header, record = 84, np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    n_triangles = int.from_bytes(content[header - 4 : header], "little")
    if len(content) != header + n_triangles * record.itemsize:
        raise ConfigError(f"{path} is no binary STL file: write it as binary STL or as OBJ")
    corners = np.frombuffer(content, record, offset=header)["corners"].reshape(-1, 3).astype(float)
    points, index = np.unique(corners, axis=0, return_inverse=True)
    return _mesh(points, index.reshape(-1, 3), path)


def _mesh(points: Array, triangles: NDArray[np.int64], path: Path) -> tuple[Array, NDArray[np.int64]]:
    if points.shape != (len(points), 3) or len(points) < 4 or not len(triangles) or not np.isfinite(points).all():
        raise ConfigError(f"{path} is no mesh: it needs four vertices and one face at least, and finite numbers")
    if triangles.min() < 0 or triangles.max() >= len(points):
        raise ConfigError(f"{path} is no mesh: a face has a corner that is no vertex")
    return points, triangles


def _pixels(content: bytes, path: Path) -> NDArray[np.uint8]:
    """Reads a picture as shades of grey, ``(rows, columns)``, its size before its content."""
    from PIL import Image

    try:
        with Image.open(BytesIO(content), formats=["PNG"]) as picture:
            if picture.width * picture.height > MOST_SAMPLES:
                raise ConfigError(f"{path} has more than {MOST_SAMPLES:,} pixels, the most of a height field")
            return np.asarray(picture.convert("L"))
    except (OSError, ValueError, SyntaxError) as error:
        raise ConfigError(f"{path} is no picture of the format PNG: {shortened(str(error))}") from None
