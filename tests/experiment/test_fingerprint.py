"""A result's key: the code that computes counts, its words and layout and the rooms beside it do not."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

import annelid
from annelid.config.kinds import every_kind
from annelid.experiment import fingerprint
from annelid.experiment.case import Case
from annelid.experiment.fingerprint import PHYSICS, READERS, code_fingerprint, room_of, run_key
from annelid_lab.calibration.base import Experiment
from annelid_studies.standard_cases import PLANAR, RODS
from imports import imported

SOURCE = Path(annelid.__file__).parent.parent
NO_RESULT = ("annelid.lazy", "annelid.markdown", "annelid.terminal", "annelid.experiment.fingerprint")
"""What is also imported, and no number depends on: how public names are loaded, tables, the progress bar, digests."""


def test_a_key_covers_all_that_its_code_imports() -> None:
    """So none is forgotten of what computes every run, of the kinds' rooms, and of what reads outcomes."""
    # Experiments of a calibration, which other tests load, are no part of a run's configuration.
    of_runs = {kind for kind in every_kind() if not issubclass(kind, Experiment)}
    kinds = {room_of(kind) for kind in of_runs if kind.__module__.startswith("annelid")}
    for room in (*PHYSICS, *kinds, *READERS):
        covered = (*PHYSICS, *NO_RESULT, room, *(READERS if room in READERS else ()))
        for path in fingerprint._files(room):
            own = [name for name in imported(path) if name.startswith("annelid")]
            beside = [name for name in own if not f"{name}.".startswith(tuple(f"{one}." for one in covered))]
            assert not beside, f"{path} imports {beside}, which are no part of the key"


def test_the_key_of_a_stored_run(copied: Path) -> None:
    """Real files are changed one after the other, each change on top of the last."""
    case = Case(RODS)
    key, planar = run_key(case.config), run_key(Case(PLANAR).config)
    for place, old, new, counts in (
        ("body/actuators/muscle.py", '"""', '"""Other words. ', False),
        ("body/actuators/muscle.py", "\n\n\nclass", "\n\n\n\n# More words.\n\nclass", False),
        ("body/actuators/muscle.py", 'description="', 'description="other ', False),
        ("draw/figures/sweep.py", "import", "import os\nimport", False),
        ("body/actuators/muscle.py", "default=117.57", "default=117.58", True),
        ("body/formulations/rods/net.py", "0.5 * ", "0.25 * ", True),
        ("errors.py", "class AnnelidError", "UNIT = 1.0\n\n\nclass AnnelidError", True),
    ):
        file = copied / place
        text = file.read_text(encoding="utf-8")
        assert old in text, (place, old)
        file.write_text(text.replace(old, new, 1), encoding="utf-8")
        forget()
        assert (run_key(case.config) != key) == counts, (place, old)
        key = run_key(case.config)
    before = run_key(Case(PLANAR).config)
    assert before != planar
    room = copied.parent.joinpath(*room_of(type(Case(PLANAR).config.body)).split("."))
    file = next(path for path in sorted(room.rglob("*.py")) if "import" in path.read_text(encoding="utf-8"))
    file.write_text(file.read_text(encoding="utf-8") + "\nMORE = 1\n", encoding="utf-8")
    forget()
    assert run_key(case.config) == key, "a kind that a run does not use is no part of its key"
    assert run_key(Case(PLANAR).config) != before


@pytest.fixture
def copied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A copy of annelid's source, which is read in place of it."""
    for package in SOURCE.glob("annelid*/"):
        shutil.copytree(package, tmp_path / package.name, ignore=shutil.ignore_patterns("__pycache__"))
    files = fingerprint._files
    monkeypatch.setattr(fingerprint, "_files", lambda name: [tmp_path / one.relative_to(SOURCE) for one in files(name)])
    forget()
    yield tmp_path / "annelid"
    monkeypatch.undo()
    forget()


def forget() -> None:
    """Has all modules read again."""
    for function in vars(fingerprint).values():
        if hasattr(function, "cache_clear"):
            function.cache_clear()


def test_a_module_counts_alone_and_a_package_with_all_that_lies_in_it() -> None:
    assert len({code_fingerprint("annelid.body"), code_fingerprint("annelid.body.worm"), code_fingerprint()}) == 3
    assert SOURCE / "annelid" / "body" / "worm.py" in fingerprint._files("annelid.body")
