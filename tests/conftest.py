"""What tests of several rooms begin with."""

from __future__ import annotations

import faulthandler
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

# Tests run side by side: threads of linear algebra that wait for each other take twice the processor time.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy as np
import pytest
from hypothesis import settings
from typer.testing import CliRunner

from annelid.cli import app
from annelid.config import ControllerKind, load_config
from annelid.protocols import Sensation
from annelid.simulation.loop import simulate
from annelid.simulation.runfile import Run, open_run
from outcome import Command, Outcome

# No test is judged by its time: a busy machine is no failure.
settings.register_profile("annelid", deadline=None)
settings.load_profile("annelid")


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Long validations have all the time they need; every other test that hangs is named and ended."""
    if item.get_closest_marker("slow") is not None:
        faulthandler.cancel_dump_traceback_later()


@pytest.fixture(autouse=True)
def _interruptions_are_heeded() -> Iterator[None]:
    """Interruptions reach the tests and what they start, also under nohup and in a shell's background jobs."""
    if (
        signal.getsignal(signal.SIGINT) is not signal.SIG_IGN
        or threading.current_thread() is not threading.main_thread()
    ):
        yield
        return
    signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@pytest.fixture
def forgotten_controllers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kinds of controllers that a test defines are known to it alone."""
    monkeypatch.setattr(ControllerKind.registry, "_known", dict(ControllerKind.registry.all()))


class InThisProcess(Executor):
    """Stands for a pool of processes, each of which would take seconds to start."""

    def __init__(self, *_: object) -> None:
        """Starts nothing."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Calls it here and now."""
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


@pytest.fixture(scope="module")
def runs_in_this_process() -> Iterator[None]:
    """Studies compute their runs here; what is special to processes is tested with the workers."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("annelid.experiment.executors.Processes", InThisProcess)
        yield


def made_once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], object]) -> Path:
    """A folder that the first process to ask for it fills, for the tests of all processes.

    Args:
        factory: pytest's temporary folders, of which each process has its own below a common one.
        name: The folder's name.
        make: Fills the folder, which is there and empty.

    Returns:
        The folder, filled.
    """
    common = factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        common = common.parent
    folder, done = common / name, common / f"{name}.done"
    try:
        folder.mkdir()
    except FileExistsError:
        while not done.exists():
            time.sleep(0.1)
        return folder
    try:
        make(folder)
    finally:
        done.touch()
    return folder


def run_made_once(factory: pytest.TempPathFactory, name: str, preset: str, duration_s: float) -> Run:
    """A run that the tests of all processes read and none changes."""
    config = load_config(preset, {"duration_s": duration_s})
    return open_run(made_once(factory, name, lambda folder: simulate(config, folder, progress=False)))


@pytest.fixture(scope="session")
def rods_run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """The first moments of a 3D worm, segment 1 contracting."""
    return run_made_once(tmp_path_factory, "rods", "riddle2023-rods", 0.2)


@pytest.fixture(scope="session")
def planar_run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Three seconds of the planar worm: one cycle and a bit."""
    return run_made_once(tmp_path_factory, "planar", "riddle2022-planar", 3.0)


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The whole site, built strictly; its tutorials, which have tests of their own, are not run for it."""
    import jupytext

    import build_site
    import notebooks

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(notebooks.CACHE_VARIABLE, str(tmp_path_factory.mktemp("tutorials")))
        patch.setattr(notebooks, "executed", lambda text: jupytext.reads(text, fmt="md"))
        return made_once(tmp_path_factory, "site", build_site.build) / "site"


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


def squeeze(sensation: Sensation) -> np.ndarray:
    """Contracts all segments alike."""
    return np.full(len(sensation.ring_length_m), 0.5)


@pytest.fixture(scope="session")
def chain_run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A worm of capsules for a moment."""
    config = load_config("riddle2023", {"duration_s": 0.02})
    return simulate(config, tmp_path_factory.mktemp("chain") / "run", progress=False)


@pytest.fixture(scope="session")
def user_run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A 3D worm under a user's function."""
    config = load_config("riddle2023-rods", {"duration_s": 0.1})
    return simulate(config, tmp_path_factory.mktemp("user") / "run", controller=squeeze, progress=False)


@pytest.fixture(scope="session", params=["planar", "rods"])
def run(request: pytest.FixtureRequest) -> Run:
    """A planar and a 3D run."""
    return request.getfixturevalue(f"{request.param}_run")


@pytest.fixture
def target(tmp_path: Path) -> Path:
    return tmp_path / "out"
