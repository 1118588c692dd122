from __future__ import annotations

from pathlib import Path

import pytest
from outcome import Command, Outcome
from typer.testing import CliRunner

from annelid.cli import app


@pytest.fixture
def annelid(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Command:
    """Runs a command in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def invoke(*arguments: str | Path) -> Outcome:
        result = CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="annelid")
        return Outcome(result.exit_code, result.stdout, result.stderr)

    return invoke


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs draw nothing, for tests of what they compute and where they write it."""
    monkeypatch.setattr("annelid.draw.gallery.draw_all", lambda *_, **__: [])


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a planar run of one second, without pictures."""
    folder = tmp_path_factory.mktemp("finished") / "run"
    result = CliRunner().invoke(
        app, ["run", "riddle2022-planar", "--duration", "1", "--no-video", "--quiet", "--out", str(folder)]
    )
    assert result.exit_code == 0, result.output
    return folder
