"""Pictures are kept while what they come from stays the same, and made anew otherwise."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from annelid_studies.riddle2023.paper import kept


class Maker:
    """Draws an empty picture and counts how often."""

    def __init__(self, stem: Path) -> None:
        self.stem = stem
        self.times = 0

    def __call__(self) -> dict[str, Any]:
        self.times += 1
        for suffix in (".svg", ".png"):
            self.stem.with_suffix(suffix).write_bytes(b"picture")
        return {"caption": f"made {self.times} times"}


@pytest.fixture
def maker(tmp_path: Path) -> Maker:
    return Maker(tmp_path / "picture")


def test_the_same_is_made_once(maker: Maker) -> None:
    first = kept(maker.stem, ["run", 1.5], maker)
    assert kept(maker.stem, ["run", 1.5], maker) == first
    assert maker.times == 1


def test_another_run_other_code_and_missing_or_damaged_files_make_it_anew(
    maker: Maker, monkeypatch: pytest.MonkeyPatch
) -> None:
    note = maker.stem.with_suffix(".json")
    kept(maker.stem, ["run"], maker)
    for i, change in enumerate(
        (
            maker.stem.with_suffix(".svg").unlink,
            maker.stem.with_suffix(".png").unlink,
            note.unlink,
            lambda: note.write_text('{"mark": ', encoding="utf-8"),
            lambda: monkeypatch.setattr("annelid_studies.riddle2023.paper.code_fingerprint", lambda *_: "other code"),
        ),
        start=2,
    ):
        change()
        assert kept(maker.stem, ["run"], maker) == {"caption": f"made {i} times"}
    assert kept(maker.stem, ["another run"], maker) == {"caption": "made 7 times"}
