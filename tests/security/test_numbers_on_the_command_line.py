"""Every numeric option of every command, given what no one means: it ends soon, in a sentence or a sane result."""

from __future__ import annotations

import signal
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Annotated, get_args, get_origin, get_type_hints

import pytest
import typer
from typer.testing import CliRunner

from annelid.cli import app
from annelid.errors import AnnelidError

LONGEST_S = 30
FLOATS = ("nan", "inf", "-inf", "0", "-1", "1e-300", "1e300")
INTEGERS = ("0", "-1", str(2**31), str(2**63), "1" + 30 * "0", "1" + 5000 * "0")
WITH: dict[str, tuple[str, ...]] = {
    "run": ("riddle2022-planar", "--no-video", "--quiet", "--out", "out"),
    "run --duration": ("riddle2022-planar", "--no-video", "--quiet", "--out", "out"),
    "run --seed": ("riddle2022-planar", "--no-video", "--quiet", "--out", "out", "--duration", "0.1"),
    "run --jobs": ("--uncertainty", "2"),
    "check": (),
    "new": ("mine.toml",),
    "compare": ("RUN", "nothere.csv", "--map", "nothere.toml"),
    "study limit-cycle": ("riddle2022-planar",),
    "export": ("RUN", "--to", "csv", "-o", "out"),
    "draw --time": ("RUN", "-o", "frame.png"),
    "draw": ("RUN", "--video", "video.mp4"),
    "view": ("riddle2022-planar", "--export", "page.html"),
    "sweep": ("nothere.toml",),
    "tune": ("nothere.toml",),
    "paper": ("--only", "nothing"),
    "study paper": ("--only", "nothing"),
    "study robustness": ("--controller", "nothing"),
    "study challenge": ("nothing",),
    "calibrate": ("nothere.toml",),
    "export-network": ("riddle2023-rods", "-o", "c"),
    "loop": ("riddle2022-planar", "--servos", "/no/such/port", "-o", "out"),
    "study": ("--scheduler", "nothing"),
    "study load-frame": ("riddle2022-planar",),
}
"""What a command needs beside the option, chosen so that a value that is taken ends soon."""
SLOW_ON_PURPOSE = {("study limit-cycle --threshold", value) for value in ("0", "-1", "1e300", "1e-300")}
"""A threshold that is never reached is waited for through a minute of simulated time."""


def numeric_options(group: typer.Typer = app, above: str = "") -> Iterator[tuple[str, str, str]]:
    """Every command, its numeric option, and a value."""
    for command in group.registered_commands:
        assert command.callback is not None
        for name, hint in get_type_hints(command.callback, include_extras=True).items():
            kind, *told = get_args(hint) if get_origin(hint) is Annotated else (hint,)
            kinds = {kind, *get_args(kind)}
            values = FLOATS if float in kinds else INTEGERS if int in kinds else ()
            declared = [word for option in told for word in option.param_decls or () if word.startswith("--")]
            for value in values:
                yield f"{above} {command.name}".strip(), (declared or [f"--{name.replace('_', '-')}"])[0], value
    for inner in group.registered_groups:
        assert inner.typer_instance is not None
        yield from numeric_options(inner.typer_instance, f"{above} {inner.name}".strip())


OPTIONS = list(numeric_options())


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short run of a planar worm."""
    from annelid import simulate
    from annelid.config import load_config

    folder = tmp_path_factory.mktemp("numbers") / "run"
    simulate(load_config("riddle2022-planar", {"duration_s": 0.2}), folder, progress=False)
    return folder


def test_the_options_are_found() -> None:
    found = {f"{command} {option}" for command, option, _ in OPTIONS}
    assert {"run --duration", "draw --speed", "study limit-cycle --threshold", "study load-frame --speed"} <= found
    assert len(found) > 20


@pytest.mark.parametrize("command", sorted({command for command, _, _ in OPTIONS}))
def test_a_number_ends_soon_in_a_sentence_or_a_result(
    command: str, run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, subtests: pytest.Subtests
) -> None:
    monkeypatch.setattr("annelid.draw.gallery.draw_all", lambda *_, **__: [])
    for option, value in [(option, value) for one, option, value in OPTIONS if one == command]:
        if (f"{command} {option}", value) in SLOW_ON_PURPOSE:
            continue
        words = next(WITH[key] for key in (f"{command} {option}", command, command.split()[0]) if key in WITH)
        arguments = [*command.split(), *(str(run) if word == "RUN" else word for word in words), f"{option}={value}"]
        monkeypatch.chdir(tempfile.mkdtemp(dir=tmp_path))
        with subtests.test(option=option, value=value[:12]), at_most(LONGEST_S):
            result = CliRunner().invoke(app, arguments, prog_name="annelid")
            assert result.exception is None or isinstance(result.exception, SystemExit | AnnelidError), result.exception
            assert "Traceback" not in result.output
            if result.exit_code:
                said = result.stderr.strip().splitlines()
                assert said, "an error says nothing"
                assert len(said[-1]) < 600


@contextmanager
def at_most(seconds: int) -> Iterator[None]:
    """Ends what takes longer, where the system has such alarms."""

    def too_long(_: int, __: FrameType | None) -> None:
        raise AssertionError(f"it takes more than {seconds} s")

    if sys.platform == "win32":
        yield
        return
    before = signal.signal(signal.SIGALRM, too_long)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
