"""Reads an MJCF file with the files that it includes, and the meshes and pictures it names, as one text.

annelid reads the files, of bounded size, from the folder of the MJCF file or below; the engine opens none.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from io import BytesIO
from itertools import pairwise
from pathlib import Path, PurePosixPath

import numpy as np
from numpy.typing import NDArray

from annelid.arena.mjcf import MOST_BYTES, SCENE, Rules, checked, checked_tree, parsed
from annelid.errors import ConfigError, shortened, shown
from annelid.protocols import Array
from annelid.text import is_line
from annelid.textfiles import line_of, read_bytes, tag_of

MOST_FILE_BYTES = 4_000_000
"""Of a mesh or a picture."""
MOST_PIXELS = 250_000
MOST_INCLUDED = 50
"""Files that a text is made of."""
_SUFFIXES = {"mesh": (".obj", ".stl"), "hfield": (".png",)}
_FOLDERS = ("meshdir", "assetdir")


def read_mjcf(path: Path, rules: Rules = SCENE, rewrite: Callable[[ET.Element], None] | None = None) -> str:
    """Reads an MJCF file and the files that it names, beside it or below its folder, as one text without references.

    Args:
        path: The file.
        rules: What it may contain.
        rewrite: Changes the tree of the file before it is checked.

    Raises:
        ConfigError: A file cannot be read, lies elsewhere or is too large, or the text is not what `checked` allows.
    """
    content = read_bytes(path, f"{rules.what} in", MOST_BYTES)
    try:
        root = parsed(content, rules)
        _include(root, path.parent, rules, [path.resolve()])
        folder = _take_folder(root)
        if rewrite is not None:
            rewrite(root)
        for element in root.iterfind("asset/*"):
            if element.tag in _SUFFIXES and "file" in element.attrib:
                _write_in(element, path.parent, folder)
        # Twice: with the lines of the file, then whole, with all that was included and written in.
        return checked(checked_tree(root, rules), rules)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None


def _include(root: ET.Element, beside: Path, rules: Rules, read: list[Path]) -> None:
    """Puts the content of included files where a text includes them; each is read once, as by the engine."""
    for parent in list(root.iter()):
        for place, child in reversed([*enumerate(parent)]):
            if child.tag != "include":
                continue
            given = child.get("file", "")
            path = _inside(beside, PurePosixPath(), given, (".xml", ".mjcf"))
            if path.resolve() in read or len(read) > MOST_INCLUDED:
                raise ConfigError(
                    f"{tag_of(child)} file={shown(given)}>: is included twice, or after {MOST_INCLUDED} others"
                )
            read.append(path.resolve())
            try:
                content = parsed(read_bytes(path, "an included file", MOST_BYTES), rules, included=True)
                _include(content, beside, rules, read)
            except ConfigError as error:
                raise ConfigError(f"{path.name}: {error}") from None
            for element in content.iter():
                vars(element)["line"] = line_of(child)  # That of the file that includes it.
            parent[place : place + 1] = list(content)


def _take_folder(root: ET.Element) -> PurePosixPath:
    """Takes the folder of meshes out of a scene: beside the file where none is named."""
    folder = PurePosixPath()
    for compiler in root.iterfind("compiler"):
        for name in reversed(_FOLDERS):
            folder = PurePosixPath(compiler.attrib.pop(name, str(folder)))
        compiler.attrib.pop("texturedir", None)
    return folder


def _write_in(element: ET.Element, beside: Path, folder: PurePosixPath) -> None:
    """Writes what an element takes from a file into its attributes."""
    path = _inside(beside, folder, element.attrib.pop("file"), _SUFFIXES[element.tag])
    element.attrib.setdefault("name", path.stem)
    content = read_bytes(path, "a file of the scene,", MOST_FILE_BYTES)
    if element.tag == "hfield":
        rows = _pixels(content, path)
        element.attrib |= {"nrow": str(rows.shape[0]), "ncol": str(rows.shape[1])}
        element.set("elevation", " ".join(map(str, rows.ravel().tolist())))
        return
    vertices, faces = _stl(content, path) if path.suffix.lower() == ".stl" else _obj(content, path)
    element.set("vertex", " ".join(f"{number:.7g}" for number in vertices.ravel().tolist()))
    element.set("face", " ".join(map(str, faces.ravel().tolist())))


def _inside(beside: Path, folder: PurePosixPath, given: str, suffixes: tuple[str, ...]) -> Path:
    """Returns the path of a file that lies beside the scene's or below it, wherever links lead."""
    # Windows' separators; its absolute paths have a colon.
    name = folder / (given.replace("\\", "/").lstrip("/") if "\\" in given else given)
    refused = f"file={shown(given)}: must be a relative path below the folder of the scene"
    if not is_line(str(name)) or name.is_absolute() or ".." in name.parts or ":" in str(name):
        raise ConfigError(f"{refused}, without '..'")
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
            if picture.width * picture.height > MOST_PIXELS:
                raise ConfigError(f"{path} has more than {MOST_PIXELS:,} pixels, the most of a height field")
            return np.asarray(picture.convert("L"))
    except (OSError, ValueError, SyntaxError) as error:
        raise ConfigError(f"{path} is no picture of the format PNG: {shortened(str(error))}") from None
