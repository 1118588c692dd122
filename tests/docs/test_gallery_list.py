"""The list of `docs/site/gallery.py` is that of the pictures and of their pages; the command remakes them."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
import tomlkit
from doc_commands import PAGES, ROOT, Command, steps_in
from test_doc_commands import check_annelid, check_program

from annelid.errors import ConfigError
from fill_tables import made_by
from gallery import cases, main, make, makers, pictures

GALLERY = "docs/gallery.md"
SHOWN = re.compile(r"""(?:!\[[^\]]*\]\(|(?:src|poster)=")(?:docs/|\.\./)?images/([^)"]+)[)"]""")


def words_of(command: str) -> Command:
    return Command(tuple(shlex.split(command)))


def test_the_list_has_every_picture_and_the_pages_that_show_it() -> None:
    shown = {page: set(SHOWN.findall(text)) for page, text in PAGES.items()}
    listed = {name: {page for page in shown if name in shown[page]} for name in pictures()}
    assert {name: set(one.pages) for name, one in pictures().items()} == listed
    assert {path.name for path in (ROOT / "docs" / "images").iterdir()} == set(pictures())
    assert set().union(*shown.values()) == set(pictures())


def test_the_gallery_shows_the_commands_of_the_list() -> None:
    _, *parts = re.split(r"(?=^!\[)", PAGES[GALLERY], flags=re.MULTILINE)
    for part in parts:
        (name,) = SHOWN.findall(part)
        first = next(step for step in steps_in(part) if isinstance(step, Command))
        assert first == words_of(pictures()[name].command), f"{GALLERY}: the command of {name} differs from the list"


def test_a_picture_can_be_made_as_the_list_says(subtests: pytest.Subtests) -> None:
    for name in pictures():
        with subtests.test(f"{name!r:.60}"):
            one = pictures()[name]
            command = words_of(one.command)
            (check_annelid if command.words[0] == "annelid" else check_program)(command)
            assert one.maker in {*makers(), "by-hand"}
            if one.results:
                assert (ROOT / "docs" / "results" / one.results).exists()
            assert all(case.config.duration_s >= one.time_s for case in cases(one).values())


def test_the_command_of_numbers_is_that_of_their_table() -> None:
    commands = made_by()
    for name, one in pictures().items():
        if one.results in commands:
            for command in map(words_of, commands[one.results].split("; ")):
                assert command.words[: len(words_of(one.command).words)] == words_of(one.command).words, name


def test_the_sweep_is_that_of_its_page() -> None:
    page = PAGES["docs/sweeps.md"]
    block = page[page.index('    preset = "riddle2025-muscles"') : page.index("## What is varied")]
    assert tomlkit.parse(re.sub(r"^    ", "", block, flags=re.MULTILINE)).unwrap() == pictures()["sweep.png"].study


def test_pictures_of_numbers_are_redrawn(tmp_path: Path) -> None:
    names = [name for name, one in pictures().items() if one.results]
    assert make(names, tmp_path / "made", tmp_path / "kept") == [tmp_path / "made" / name for name in names]
    assert {path.read_bytes()[1:4] for path in (tmp_path / "made").iterdir()} == {b"PNG"}


@pytest.mark.slow
def test_a_worm_is_drawn_once_its_run_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    short = {"command": "annelid run riddle2022-planar --duration 0.2", "minutes": 0.1, "pages": []}
    listed = {"walk.png": short | {"maker": "frame", "time_s": 0.1}, "figure7.png": short | {"maker": "figure7"}}
    known = {name: type(pictures()["worm.png"])(**one) for name, one in listed.items()}
    monkeypatch.setattr("gallery.pictures", lambda: known)
    for _ in range(2):
        make((), tmp_path / "made", tmp_path / "kept")
    assert {path.name for path in (tmp_path / "made").iterdir()} == set(known)
    assert len(list((tmp_path / "kept" / "runs").glob("run-*"))) == 1


def test_the_list_is_printed_and_unknown_names_are_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["gallery.py", "--list"])
    main()
    assert "slip.png" in capsys.readouterr().out
    for name, sentence in (("slip", "slip.png"), ("live_view.png", "annelid view")):
        with pytest.raises(ConfigError, match=sentence):
            make([name])
