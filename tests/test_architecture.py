"""Who may import whom, and what `import annelid` does not load."""

from __future__ import annotations

import ast
import inspect
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from importlib import import_module
from pathlib import Path

import pytest

import annelid
from annelid.config.kinds import Kind, every_kind

SOURCE = Path(annelid.__file__).parent
BASE = {"errors", "lazy", "markdown", "protocols", "clock", "text", "terminal", "textfiles", "output", "registry"}
MAY_IMPORT = {
    "errors": {"text"},
    "lazy": set(),
    "markdown": {"text"},
    "protocols": set(),
    "clock": set(),
    "text": set(),
    "terminal": {"text"},
    "textfiles": {"errors", "text"},
    "output": {"errors", "text"},
    "registry": {"errors"},
    "engine": {"errors"},
    "morphology": set(),
    "plausibility": {"config", "morphology", "body"} | BASE,
    "nervous": {"errors", "lazy", "markdown", "text", "textfiles"},
    "planar": {"lazy"},
    "config": {"errors", "text", "textfiles", "registry"},
    "references": {"config"},
    "arena": {"config", "morphology"} | BASE,
    "body": {"config", "morphology", "arena", "engine"} | BASE,
    "control": {"config", "nervous"} | BASE,
    "simulation": {"config", "morphology", "plausibility", "arena", "body", "control", "nervous"} | BASE,
    "analysis": {"config", "morphology", "arena", "body", "control", "simulation"} | BASE,
    "draw": {"config", "engine", "morphology", "nervous", "arena", "body", "simulation", "analysis"} | BASE,
    "live": {"config", "morphology", "nervous", "arena", "body", "simulation", "analysis", "draw"} | BASE,
    "environments": {"config", "morphology", "arena", "body", "simulation", "analysis", "draw"} | BASE,
    "experiment": {"config", "morphology", "plausibility", "arena", "body", "simulation", "analysis", "draw"} | BASE,
    "export": {"config", "references", "body", "simulation", "analysis", "draw", "live"} | BASE,
    "cli": {
        "config",
        "plausibility",
        "references",
        "nervous",
        "body",
        "simulation",
        "analysis",
        "draw",
        "live",
        "experiment",
        "export",
    }
    | BASE,
}
SECTIONS = ("body", "arena", "controller", "turning", "rings", "formulation")
NUMPY_ONLY = {"morphology", "nervous", "protocols"}


def room_of(module: Path) -> str:
    relative = module.relative_to(SOURCE)
    return relative.parts[0].removesuffix(".py")


def executed(node: ast.AST) -> Iterator[ast.AST]:
    """All parts of a module that run some time, so not what stands there for type checkers only."""
    for part in ast.iter_child_nodes(node):
        if isinstance(part, ast.If) and isinstance(part.test, ast.Name) and part.test.id == "TYPE_CHECKING":
            continue
        yield part
        yield from executed(part)


def imported(module: Path) -> set[str]:
    """Full names of all that a module imports, wherever the statement stands; what only types need does not count."""
    names: set[str] = set()
    for node in executed(ast.parse(module.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: relative import"
            base = node.module or ""
            names |= {f"{base}.{alias.name}" if base == "annelid" else base for alias in node.names}
    return names


MODULES = [path for path in sorted(SOURCE.rglob("*.py")) if path.parent != SOURCE or "__" not in path.name]


def test_imports_run_one_way() -> None:
    wrong = []
    for module in MODULES:
        room = room_of(module)
        rooms = {name.split(".")[1] for name in imported(module) if name.startswith("annelid.")}
        wrong += [f"{module.relative_to(SOURCE)}: {other}" for other in rooms - {room} - MAY_IMPORT[room]]
    assert not wrong


def test_nervous_system_and_geometry_know_numpy_only() -> None:
    wrong = []
    for module in MODULES:
        if room_of(module) in NUMPY_ONLY:
            packages = {name.split(".")[0] for name in imported(module)} - set(sys.stdlib_module_names)
            wrong += [f"{module.name}: {package}" for package in packages - {"annelid", "numpy"}]
    assert not wrong


LAB, STUDIES = SOURCE.with_name("annelid_lab"), SOURCE.with_name("annelid_studies")
BELOW = {SOURCE: set(), LAB: {"annelid"}, STUDIES: {"annelid", "annelid_lab"}}
"""The packages that each of the three may import."""


def test_the_packages_import_one_way_and_by_public_names() -> None:
    """The lab and the studies are written as anybody's code is: names in the ``__all__`` of annelid and its rooms."""
    wrong = []
    assert all((package / "__init__.py").exists() for package in BELOW)
    for package, below in BELOW.items():
        for module in package.rglob("*.py"):
            for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
                if not isinstance(node, ast.Import | ast.ImportFrom):
                    continue
                names = [alias.name for alias in node.names]
                homes = names if isinstance(node, ast.Import) else [node.module or ""]
                others = {home.split(".")[0] for home in homes if home.startswith("annelid")} - {package.name}
                where = f"{module.relative_to(SOURCE.parent)}, line {node.lineno}"
                wrong += [f"{where}: {other}" for other in others - below]
                if "annelid" in others:
                    room = import_module(homes[0]) if homes[0].count(".") < 2 else None
                    wrong += [f"{where}: {name}" for name in set(names) - set(getattr(room, "__all__", ()))]
    assert not wrong


def modules_of(package: Path) -> dict[str, Path]:
    """Every module of a package, by its full name."""
    names = {path: path.relative_to(package.parent).with_suffix("").parts for path in package.rglob("*.py")}
    return {".".join(parts[:-1] if parts[-1] == "__init__" else parts): path for path, parts in names.items()}


def test_no_circle_of_imports() -> None:
    """Wherever the statement stands: at the top, in a function, or for type checkers only."""
    modules = {name: path for package in BELOW for name, path in modules_of(package).items()}
    assert {"annelid.body.worm", "annelid_studies.riddle2023.paper"} <= modules.keys()
    needed: dict[str, set[str]] = {name: set() for name in modules}
    for name, path in modules.items():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                needed[name] |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                below = {f"{node.module}.{alias.name}" for alias in node.names}
                needed[name] |= {module if module in modules else str(node.module) for module in below}
    order = TopologicalSorter({name: others & modules.keys() for name, others in needed.items()})
    try:
        order.prepare()
    except CycleError as error:
        pytest.fail(f"a circle of imports: {' <- '.join(error.args[1])}")


def kinds_and_their_bases() -> set[type[Kind]]:
    """The kinds of all families, and the classes between a family's base and them, such as `WormBody`."""
    families = set(Kind.__subclasses__())
    bases = {base for kind in every_kind() for base in kind.__mro__ if issubclass(base, Kind)}
    return bases - families - {Kind}


def test_no_kind_is_told_apart_outside_its_room() -> None:
    """Behaviour comes from the kind itself: nobody asks which one it is, by its class or by its name."""
    home = {kind.__name__: Path(inspect.getfile(kind)).resolve().parent for kind in kinds_and_their_bases()}
    assert {"WormBody", "MeshBody", "PlanarWorm", "Rods", "Floor"} <= home.keys()
    wrong = []
    for module in (path for package in BELOW for path in package.rglob("*.py")):
        for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
            asked: set[str] = set()
            if isinstance(node, ast.Call) and ast.unparse(node.func) in ("isinstance", "issubclass"):
                asked = {part.id for part in ast.walk(node.args[1]) if isinstance(part, ast.Name)} & home.keys()
            elif isinstance(node, ast.MatchClass):
                asked = {ast.unparse(node.cls)} & home.keys()
            elif isinstance(node, ast.Compare | ast.Subscript):
                parts = (node.left, *node.comparators) if isinstance(node, ast.Compare) else (node.slice,)
                kinds = [part for part in parts if isinstance(part, ast.Attribute) and part.attr == "kind"]
                asked = {text for part in kinds if (text := ast.unparse(part)).split(".")[-2].lstrip("_") in SECTIONS}
            rooms = module.resolve().parents
            wrong += [(str(module), ast.unparse(node), name) for name in asked if home.get(name) not in rooms]
    assert not wrong


def test_every_room_has_its_rule() -> None:
    assert {room_of(path) for path in MODULES} == set(MAY_IMPORT)


def loaded_by(statement: str) -> set[str]:
    code = f"import sys; {statement}; print(' '.join(sys.modules))"
    quiet = {
        name: value for name, value in os.environ.items() if name != "MUJOCO_GL"
    }  # it makes the engine load OpenGL
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120, env=quiet
    )
    return set(answer.stdout.split())


def test_importing_annelid_loads_nothing_heavy() -> None:
    heavy = {"OpenGL", "glfw", "torch", "matplotlib", "mujoco", "xarray", "imageio"}
    assert heavy & loaded_by("import annelid") == set()


def test_simulating_needs_neither_opengl_nor_matplotlib_nor_torch() -> None:
    loaded = loaded_by("import annelid.simulation, annelid.simulation.worm, annelid.control, annelid.analysis")
    assert loaded & {"OpenGL", "torch", "matplotlib", "sns_toolbox"} == set()


def test_a_run_comes_to_its_table_without_what_only_pictures_and_studies_need(tmp_path: Path) -> None:
    barred = (
        "OpenGL",
        "imageio",
        "markdown_it",
        "matplotlib",
        "optuna",
        "pandas",
        "scipy",
        "tomlkit",
        "torch",
        "viser",
        "xarray",
    )
    program = (
        f"import sys; sys.modules.update(dict.fromkeys({barred}))\n"
        "import annelid.draw.gallery as gallery; gallery.draw_all = lambda *_, **__: ()\n"
        f"from annelid.cli import app; app(['run', '--duration', '0.01', '-o', {str(tmp_path / 'run')!r}])"
    )
    quiet = {name: value for name, value in os.environ.items() if name != "MUJOCO_GL"}
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False, timeout=120, env=quiet
    )
    assert done.returncode == 0, done.stderr
    assert "this run" in done.stdout


ROOMS = ["annelid", *sorted(f"annelid.{path.parent.name}" for path in SOURCE.glob("*/__init__.py"))]


def test_every_public_name_can_be_had_and_documents_its_arguments_and_errors() -> None:
    wrong = []
    for room in ROOMS:
        module = import_module(room)
        for name in getattr(module, "__all__", ()):
            function = getattr(module, name)
            if not inspect.isfunction(function):
                # A module of the room with the same name would hide what is loaded on first use.
                assert not inspect.ismodule(function), f"{room}.{name}"
                continue
            text, own = inspect.getdoc(function) or "", list(inspect.signature(function).parameters)
            _, stands, arguments = text.partition("Args:")
            if not stands and len(own) > 1:
                wrong.append(f"{room}.{name} documents no arguments")
            if stands:
                missing = [one for one in own if not re.search(rf"\b{one}\b", arguments)]
                wrong += [f"{room}.{name} does not document {one}" for one in missing]
            if "raise " in inspect.getsource(function) and "Raises:" not in text:
                wrong.append(f"{room}.{name} documents no error")
    assert not wrong
