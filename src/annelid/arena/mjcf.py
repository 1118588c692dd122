"""Reads a scene, the static ground and the movable things of an MJCF file, as data: what may be in it is listed here.

A scene is one text without references: what its file takes from other files is written into the text when it is read
(`read_scene`), and whatever comes out of a configuration or a run file is checked again before the engine sees it
(`checked`). The engine parses no text that has not passed, and opens no file.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from io import BytesIO
from itertools import pairwise
from math import isfinite
from pathlib import Path, PurePosixPath

import numpy as np
from numpy.typing import NDArray

from annelid.errors import ConfigError, listed, shortened, shown
from annelid.protocols import Array
from annelid.text import is_line
from annelid.textfiles import read_bytes

MOST_BYTES = 1_000_000
"""Of a scene as one text."""
MOST_FILE_BYTES = 4_000_000
"""Of a mesh or a picture that it takes from a file."""
MOST_ELEMENTS, MOST_LEVELS = 2_000, 24
MOST_VERTICES, MOST_SAMPLES, MOST_PIXELS = 20_000, 250_000, 1024
"""Of all meshes together, of all height fields together, and along the side of a texture, or of all as one square."""
MOST_OBJECTS = 16
"""Things that move: the force of the worm on each is measured at every part of its skin."""
LARGEST = 1e6
"""Of any number: beyond it nothing is a length, a mass or a stiffness in SI units."""

_TURN = "quat axisangle euler xyaxes zaxis"
_GEOM = (
    f"name class type size pos fromto {_TURN} mass density friction solref solimp solmix priority condim contype "
    "conaffinity group rgba material mesh hfield shellinertia fitscale"
)
_JOINT = (
    "name class type pos axis range limited stiffness springref damping frictionloss armature ref solreflimit "
    "solimplimit solreffriction solimpfriction"
)
_MESH = "name class vertex face scale refpos refquat inertia smoothnormal maxhullvert"
_MATERIAL = "name class texture texrepeat texuniform rgba emission specular shininess reflectance"
_THINGS = "body geom frame"
_ALLOWED = {
    "mujoco": ("compiler default asset worldbody", "model"),
    "compiler": ("", "angle eulerseq autolimits"),
    "default": ("default geom joint mesh material", "class"),
    "asset": ("mesh hfield texture material", ""),
    "mesh": ("", _MESH),
    "hfield": ("", "name nrow ncol size elevation"),
    "texture": ("", "name type builtin rgb1 rgb2 mark markrgb random width height"),
    "material": ("", _MATERIAL),
    "worldbody": (_THINGS, ""),
    "frame": (_THINGS, f"name childclass pos {_TURN}"),
    "body": (f"{_THINGS} inertial joint freejoint", f"name childclass pos {_TURN}"),
    "inertial": ("", f"pos {_TURN} mass diaginertia fullinertia"),
    "joint": ("", _JOINT),
    "freejoint": ("", "name"),
    "geom": ("", _GEOM),
}
"""Elements, each with those that may be in it and its attributes."""
_FILES = {"mesh": ("file", (".obj", ".stl")), "hfield": ("file", (".png",))}
_FOLDERS = ("meshdir", "assetdir")
_NAMES = frozenset(["name", "class", "childclass", "mesh", "hfield", "material", "texture", "model"])
_WORDS = ["type", "builtin", "mark", "inertia", "angle", "eulerseq"]
_CHOICES = frozenset([*_WORDS, "autolimits", "limited", "smoothnormal", "texuniform", "shellinertia"])
_SINGLE = frozenset(["stiffness", "mass", "density", "nrow", "ncol", "width", "height", "maxhullvert"])
_INSTEAD = {
    "include": "write its content into the file",
    "option": "gravity, step and friction cone are fields of the configuration (arena.gravity_m_per_s2, "
    "clock.physics_timestep_s, arena.friction_cone)",
    "size": "the engine finds the sizes itself",
    "extension": "plug-ins are code",
    "plugin": "plug-ins are code",
    "light": "pictures have a light of their own",
    "camera": "pictures have views of their own (--camera)",
    "visual": "pictures have a look of their own",
    "statistic": "pictures have a scale of their own",
    "actuator": "nothing drives the things of a scene but the worm, gravity and springs",
    "keyframe": "a scene starts as it is written",
    "sensor": "annelid records the things that move itself",
    "replicate": "write out what it repeats",
    "tendon": "use the stiffness of joints",
    "equality": "use joints",
    "contact": "use contype and conaffinity",
}
"""What to do without an element that MJCF has and a scene has not."""


class _Builder(ET.TreeBuilder):
    """Builds the tree of a text that is bounded in elements and depth and has no document type, hence no entities."""

    def __init__(self) -> None:
        super().__init__()
        self._elements = self._level = 0

    def doctype(self, *_: object) -> None:
        raise ConfigError("has a document type (<!DOCTYPE ..>), which a scene cannot have: remove it")

    def start(self, tag: str, attrs: dict[str, str]) -> ET.Element:  # pyright: ignore[reportIncompatibleMethodOverride]
        self._elements, self._level = self._elements + 1, self._level + 1
        if self._elements > MOST_ELEMENTS:
            raise ConfigError(f"has more than {MOST_ELEMENTS:,} elements, the most of a scene")
        if self._level > MOST_LEVELS:
            raise ConfigError(f"is nested deeper than {MOST_LEVELS} levels, the most of a scene")
        return super().start(tag, attrs)

    def end(self, tag: str) -> ET.Element:
        self._level -= 1
        return super().end(tag)


def read_scene(path: Path) -> str:
    """Reads an MJCF file and the files that it names, beside it or below its folder, as one text without references.

    Raises:
        ConfigError: A file cannot be read, lies elsewhere or is too large, or the scene is not what `checked` allows.
    """
    content = read_bytes(path, "the scene", MOST_BYTES)
    try:
        root = _parsed(content)
        folder = _take_folder(root)
        for element in root.iterfind("asset/*"):
            if element.tag in _FILES and "file" in element.attrib:
                _write_in(element, path.parent, folder)
        return checked(ET.tostring(root, encoding="unicode"))
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None


def checked(text: str) -> str:
    """Checks a scene and returns it as the engine gets it: its elements and attributes alone, and movable bodies named.

    Raises:
        ConfigError: It is too long, no XML, or has an element, an attribute or a value that a scene cannot have.
    """
    if len(text) > MOST_BYTES:
        raise ConfigError(f"is too long: more than {MOST_BYTES / 1e6:g} MB of text, meshes included, are no scene")
    root = _parsed(text)
    if root.tag != "mujoco":
        raise ConfigError(f"begins with <{shortened(root.tag)}>: an MJCF file begins with <mujoco>")
    _check(root)
    _check_sizes(root)
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


def _parsed(text: str | bytes) -> ET.Element:
    parser = ET.XMLParser(target=_Builder())
    try:
        parser.feed(text)
        return parser.close()
    except (ET.ParseError, ValueError, LookupError) as error:
        raise ConfigError(f"is not valid XML: {shortened(str(error))}") from None


def _check(element: ET.Element) -> None:
    inner, attributes = (names.split() for names in _ALLOWED[element.tag])
    for name, value in element.attrib.items():
        if name not in attributes:
            raise ConfigError(
                f"<{element.tag} {shortened(name)}=..>: a scene cannot have this attribute; valid: "
                f"{listed(sorted(attributes)) or 'none'}"
            )
        _check_value(element.tag, name, value)
    # What stands between the elements means nothing to the engine.
    element.text = element.tail = None
    for child in element:
        if child.tag not in inner:
            instead = f"; {_INSTEAD[child.tag]}" if child.tag in _INSTEAD else ""
            raise ConfigError(
                f"<{element.tag}> has <{shortened(child.tag)}>, which a scene cannot have{instead}. Valid there: "
                f"{listed(sorted(inner)) or 'nothing'}"
            )
        _check(child)


def _check_value(tag: str, name: str, value: str) -> None:
    if name in _NAMES:
        if not is_line(value) or len(value) > 100 or "/" in value:
            raise ConfigError(f"<{tag} {name}={shown(value)}>: must be at most 100 printable characters without '/'")
    elif name in _CHOICES:
        if not value.isalnum() or len(value) > 20 or value == "sdf":
            raise ConfigError(f"<{tag} {name}={shown(value)}>: a scene cannot have this value")
    else:
        numbers = _numbers(value)
        if numbers is None or not len(numbers) or (len(numbers) > 1 and name in _SINGLE):
            wanted = "one number" if name in _SINGLE else "numbers"
            raise ConfigError(f"<{tag} {name}={shown(value)}>: must be {wanted} of at most {LARGEST:g}")


def _numbers(value: str) -> list[float] | None:
    """Returns the numbers of an attribute, None where it has anything else."""
    try:
        numbers = [float(word) for word in value.split()]
    except ValueError:
        return None
    # Python also reads 1_000 and digits of other scripts, the engine does not.
    plain = value.isascii() and "_" not in value
    return numbers if plain and all(isfinite(number) and abs(number) <= LARGEST for number in numbers) else None


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
