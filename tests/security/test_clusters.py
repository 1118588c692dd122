"""No file chooses who computes, and what a worker elsewhere sends is the run that was asked for, or nothing."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import annelid
from annelid.cli import app
from annelid.errors import ClusterError, ConfigError, MissingDependency
from annelid.experiment import executors
from annelid.experiment.case import Case
from annelid.experiment.executors import scheduler
from annelid.experiment.outcome import OUTCOME_NAME
from annelid.experiment.store import Store, attempt, case_key
from annelid.simulation.runfile import FILE_NAME
from annelid_studies.standard_cases import PLANAR

STUDY = """
preset = "riddle2022-planar"
set.duration_s = 0.1
[[vary]]
field = "body.gain"
values = [1.0]
"""


@pytest.fixture
def listening() -> Iterator[socket.socket]:
    """A port of this machine where a stranger waits for somebody to join."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.setblocking(False)
        yield server


def visited(server: socket.socket) -> bool:
    try:
        server.accept()[0].close()
    except BlockingIOError:
        return False
    return True


@pytest.mark.usefixtures("runs_in_this_process")
def test_a_study_does_not_choose_who_computes_it(
    listening: socket.socket, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    address = f"tcp://127.0.0.1:{listening.getsockname()[1]}"
    Path("study.toml").write_text(f'{STUDY}[cluster]\nkind = "scheduler"\naddress = "{address}"\n')
    done = CliRunner().invoke(app, ["sweep", "study.toml", "--quiet"])
    assert done.exit_code == 2
    assert "a study names no cluster any more: leave it out, and give --scheduler ADDRESS" in done.stderr
    with pytest.raises(ConfigError, match="names no cluster any more"):
        annelid.sweep("study.toml", "again")
    with pytest.raises(ConfigError, match="give --scheduler ADDRESS, or executor= in Python"):
        annelid.sweep({"preset": PLANAR, "vary": [{"field": "seed", "values": [1]}]}, cluster=address)
    assert not visited(listening)


def test_the_scheduler_that_the_user_names_is_joined_and_a_silent_one_is_not_waited_for(
    listening: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(executors, "JOIN_S", 0.5)
    address = f"tcp://127.0.0.1:{listening.getsockname()[1]}"
    with pytest.raises(ClusterError, match=f"no scheduler answers at {address}: start one with"), scheduler(address):
        pass
    assert visited(listening)


def test_without_dask_the_line_that_installs_it_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(MissingDependency, match=r"pip install 'annelid\[sweep\]'"), scheduler("tcp://127.0.0.1:9"):
        pass


CONTENTS = {
    "[" * 100_000: "nested too deeply",
    "{": "not valid JSON",
    "[]": "has address = None: must be tcp://HOST:PORT",
    '{"address": 1}': "has address = 1: must be",
    '{"address": "other.json"}': "has address = 'other.json': must be",
    '{"address": "tcp://a\\n:1"}': r"has address = 'tcp://a\n:1': must be",
    "": "a pipe or a device, not a file",
}


def test_an_address_is_one_and_a_scheduler_file_is_read_as_every_other(tmp_path: Path) -> None:
    for number, (content, words) in enumerate(CONTENTS.items()):
        path = tmp_path / f"{number}.json"
        if content:
            path.write_text(content)
        elif hasattr(os, "mkfifo"):
            os.mkfifo(path)
        else:
            continue
        assert words in refused(str(path))
    for address in ("tcp://a\t:1", "tls://a\n:1", "tcp://\x1b[2J", "here", "study.toml"):
        assert "must be tcp://HOST:PORT, tls://HOST:PORT, or the path of a scheduler file" in refused(address)
    assert "cannot read the scheduler file" in refused(str(tmp_path / "nowhere.json"))


def refused(where: str) -> str:
    with pytest.raises(ConfigError) as error, scheduler(where):
        pass
    assert str(error.value).isprintable()
    return str(error.value)


CASE = Case(PLANAR, {"duration_s": 0.1})
OTHER = Case(PLANAR, {"duration_s": 0.1, "body.gain": 0.9})


class Away(Executor):
    """A worker on another machine that sends what the test says."""

    def __init__(self, sent: object) -> None:
        self.sent = sent

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future = Future[Any]()
        future.set_result(self.sent)
        return future


@pytest.fixture(scope="module")
def sent(tmp_path_factory: pytest.TempPathFactory) -> list[bytes]:
    """What an honest worker sends of `CASE` and of `OTHER`."""
    folder = str(tmp_path_factory.mktemp("runs") / "away")
    found = [attempt(case_key(case), case.config.model_dump_json(), folder, "mark") for case in (CASE, OTHER)]
    return [content for content in found if content is not None]


def test_what_a_worker_sends_is_the_run_that_was_asked_for(tmp_path: Path, sent: list[bytes]) -> None:
    content, other = sent
    mappings = {"../../evil": content}, {FILE_NAME: content, OUTCOME_NAME: b"{}"}, {}
    for forged in (*mappings, [content], bytearray(content), "text", 5, b"no run", content[:-1], b"", other):
        store = Store(tmp_path / "a" / "b" / "runs", Away(forged))
        with pytest.raises(ClusterError, match="a worker sent no run for riddle2022-planar") as error:
            store.compute([CASE], failed={})
        assert len(str(error.value)) < 500
        assert [path.name for path in tmp_path.rglob("*")] == ["a", "b", "runs", ".store"]
    store = Store(tmp_path / "honest", Away(content))
    store.compute([CASE])
    assert {path.name for path in store.path(CASE).iterdir()} == {FILE_NAME, OUTCOME_NAME}
