"""A result's key: every constant of the code that computes counts, its words and layout do not."""

from __future__ import annotations

import ast
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from annelid.experiment import fingerprint
from annelid.experiment.case import Case
from annelid.experiment.fingerprint import PHYSICS, READERS, SOURCE, code_fingerprint, code_of, modules_behind
from annelid.experiment.store import case_key
from annelid_studies.worms import RODS

COMPUTING = sorted(
    path
    for room in ("config", "arena", "body", "nervous", "control", "planar", "simulation")
    for path in (SOURCE / "annelid" / room).rglob("*.py")
    if path != SOURCE / "annelid" / "simulation" / "progress.py"
)


def test_the_key_of_a_run_covers_all_that_computes_it_and_nothing_else() -> None:
    modules = modules_behind(*PHYSICS)
    others = ("engine", "errors", "output", "plausibility", "protocols", "registry", "text", "textfiles")
    rooms = {".".join(name.split(".")[:2]) for name in modules}
    assert rooms == {*PHYSICS, *(f"annelid.{room}" for room in others)}
    assert {name_of(path) for path in COMPUTING} <= modules
    assert "annelid.simulation.progress" not in modules


def test_the_key_of_an_outcome_covers_all_that_reads_it() -> None:
    modules = modules_behind(*READERS)
    readers = ("experiment.outcome", "analysis.summary", "analysis.gait", "analysis.rhythm", "simulation.runfile")
    assert {f"annelid.{name}" for name in readers} <= modules
    assert not {name for name in modules if name.split(".")[1] in ("draw", "live", "cli", "export")}


def test_a_module_is_found_where_a_package_loads_its_names_on_first_use() -> None:
    modules = modules_behind("annelid_studies.robustness")
    assert {"annelid.analysis.rhythm", "annelid.experiment.store", "annelid_studies.tables"} <= modules
    assert "annelid.experiment.tune" not in modules


def test_a_module_is_found_by_its_import_wherever_it_stands(copied: Path) -> None:
    before = code_fingerprint(*PHYSICS)
    (copied / "added.py").write_text("SHARE = 0.5\n")
    forget()
    assert code_fingerprint(*PHYSICS) == before
    rods = copied / "body" / "formulations" / "rods" / "net.py"
    rods.write_text(
        rods.read_text() + "\n\ndef late() -> float:\n    from annelid import added\n\n    return added.SHARE\n"
    )
    forget()
    assert "annelid.added" in modules_behind(*PHYSICS)


@pytest.mark.parametrize("path", COMPUTING, ids=lambda path: str(path.relative_to(SOURCE)))
def test_every_constant_counts(path: Path) -> None:
    n_changed = 0
    for statement in ast.parse(path.read_bytes()).body:
        before = code_of(statement)
        for constant in constants(statement):
            value = constant.value
            constant.value = mutated(value)  # pyright: ignore[reportAttributeAccessIssue]
            assert code_of(statement) != before, f"line {constant.lineno}: {value!r}"
            constant.value = value
            n_changed += 1
        assert code_of(statement) == before
    assert n_changed or path.name in ("__init__.py", "way.py")


@pytest.mark.parametrize("path", COMPUTING, ids=lambda path: str(path.relative_to(SOURCE)))
def test_words_and_layout_do_not_count(path: Path) -> None:
    tree = ast.parse(path.read_bytes())
    before = code_of(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            node.value.value = "other words"
        elif isinstance(node, ast.keyword) and node.arg == "description":
            node.value = ast.Constant("other words")
    # Written anew from its tree, the module has no comments and another layout.
    assert code_of(ast.parse(f"# First.\n\n{ast.unparse(tree)}\n# Last.\n")) == before


def test_the_version_of_python_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    tree = ast.parse("def double(x):\n    return 2 * x\n")
    told = set[str]()
    for fields in ("name", "args", "body", "decorator_list", "returns", "type_comment"), ast.FunctionDef._fields:
        # Python 3.12 knows of parameters of type, which the code here has none of.
        for further in (), ("type_params",):
            monkeypatch.setattr(ast.FunctionDef, "_fields", tuple(dict.fromkeys((*fields, *further))))
            tree.body[0].type_params = []  # type: ignore[attr-defined]
            told.add(code_of(tree))
    assert len(told) == 1


def test_what_runs_instead_of_an_import_for_type_checkers_counts() -> None:
    text = "if TYPE_CHECKING:\n    import {}\nelse:\n    SHARE = {}\n"
    one, other, changed = (code_of(ast.parse(text.format(*each))) for each in (("a", 1), ("b", 1), ("a", 2)))
    assert one == other != changed


def test_the_key_of_a_stored_run(copied: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Real files are changed one after the other, each change on top of the last."""
    monkeypatch.setattr("annelid.experiment.store.physics_fingerprint", lambda: code_fingerprint(*PHYSICS))
    case = Case(RODS)
    key = case_key(case)
    for place, old, new, counts in (
        ("simulation/progress.py", '"""How far a run', '""" How far a run', False),
        ("body/actuators/muscle.py", "default=117.57", "default=117.58", True),
        ("body/formulations/rods/net.py", "0.5 * ", "0.25 * ", True),
        ("errors.py", "class AnnelidError", "UNIT = 1.0\n\n\nclass AnnelidError", True),
    ):
        file = copied / place
        text = file.read_text(encoding="utf-8")
        assert old in text, (place, old)
        file.write_text(text.replace(old, new, 1), encoding="utf-8")
        forget()
        assert (case_key(case) != key) == counts, (place, old)
        key = case_key(case)


@pytest.fixture
def copied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A copy of the package's source, which is read in place of it."""
    for package in fingerprint.PACKAGES:
        shutil.copytree(SOURCE / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(fingerprint, "SOURCE", tmp_path)
    forget()
    yield tmp_path / "annelid"
    monkeypatch.undo()
    forget()


def forget() -> None:
    """Has all modules read again."""
    for function in vars(fingerprint).values():
        if hasattr(function, "cache_clear"):
            function.cache_clear()


def name_of(path: Path) -> str:
    return ".".join(path.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__")


def constants(node: ast.AST) -> Iterator[ast.Constant]:
    """All constants that are neither documentation nor the description of a field."""
    for inner in ast.iter_child_nodes(node):
        if isinstance(inner, ast.Expr) and isinstance(inner.value, ast.Constant):
            continue
        if isinstance(inner, ast.keyword) and inner.arg == "description":
            assert isinstance(node, ast.Call)
            assert isinstance(node.func, ast.Name)
            assert node.func.id == "Field"
            continue
        if isinstance(inner, ast.Constant):
            yield inner
        yield from constants(inner)


def mutated(value: object) -> object:
    if isinstance(value, bool) or value is None or value is ...:
        return "something else"
    if isinstance(value, str):
        return f"{value}~"
    if isinstance(value, bytes):
        return value + b"~"
    assert isinstance(value, int | float | complex)
    return value + 1 if value + 1 != value else value * 2
