"""No file chooses who computes."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

import annelid
from annelid.cli import app
from annelid.errors import ClusterError, ConfigError, MissingDependency
from annelid.experiment import executors
from annelid.experiment.executors import scheduler

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
        annelid.sweep({"preset": "riddle2022-planar", "vary": [{"field": "seed", "values": [1]}]}, cluster=address)
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
