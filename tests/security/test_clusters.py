"""Clusters that a file describes are not used, job scripts hold what they should only, and workers send runs only."""

from __future__ import annotations

import asyncio
import json
import os
import re
import socket
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from functools import reduce
from pathlib import Path
from typing import Any

import psutil
import pytest
from typer.testing import CliRunner

import annelid
from annelid.cli import app
from annelid.config import find_cluster
from annelid.config.cluster import Slurm
from annelid.errors import ClusterError, ConfigError
from annelid.experiment.attempt import MOST_BYTES, OUTCOME_NAME, Task, Work, attempt, own_code
from annelid.experiment.case import Case
from annelid.experiment.cluster import slurm_cluster
from annelid.experiment.store import Store, case_key
from annelid.experiment.workers import Result, Workers
from annelid.simulation.runfile import FILE_NAME
from annelid_studies.worms import PLANAR

STUDY = """
preset = "riddle2022-planar"
set.duration_s = 0.1
[[vary]]
field = "body.gain"
values = [1.0]
"""


@pytest.fixture
def scheduler() -> Iterator[socket.socket]:
    """A port of this machine where a stranger waits for somebody to join."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        listening.setblocking(False)
        yield listening


def visited(listening: socket.socket) -> bool:
    try:
        listening.accept()[0].close()
    except BlockingIOError:
        return False
    return True


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scheduler: socket.socket) -> str:
    """The name of a study that describes a cluster of that stranger; runs would be computed here and now."""
    monkeypatch.chdir(tmp_path)
    address = f"tcp://127.0.0.1:{scheduler.getsockname()[1]}"
    cluster = f'[cluster]\nkind = "scheduler"\naddress = "{address}"\nreconnect_s = 0.5\n'
    Path("study.toml").write_text(STUDY + cluster)
    monkeypatch.setattr("annelid.experiment.workers.Processes.submit", lambda _, task: computed(task))
    monkeypatch.setattr("annelid.experiment.sweep.write_results", lambda *_: [])
    return "study.toml"


def computed(task: Task) -> Result:
    future = Future[bytes | None]()
    future.set_result(attempt(task))
    return future


def test_a_study_does_not_choose_who_computes_it(study: str, scheduler: socket.socket) -> None:
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        done = CliRunner().invoke(app, ["sweep", study, "--quiet"])
        assert done.exit_code == 0, done.output
        annelid.sweep(study, "again")
    assert not visited(scheduler)
    sentences = [str(one.message) for one in told if "cluster" in str(one.message)]
    assert len(sentences) == 2
    assert re.search(r"describes a cluster \(scheduler tcp://127\.0\.0\.1:\d+\): not used; ", sentences[0])
    assert sentences[0].endswith("add --cluster study.toml to use it")
    assert sentences[1].endswith('pass cluster="study.toml" to use it')


def test_a_cluster_that_the_user_names_is_used(
    study: str, scheduler: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("annelid.experiment.cluster.HANDSHAKE_S", 0.5)
    done = CliRunner().invoke(app, ["sweep", study, "--quiet", "--cluster", study])
    assert done.exit_code == 2
    assert "no scheduler answers at tcp://127.0.0.1" in done.stderr
    assert visited(scheduler)


@pytest.mark.parametrize("address", ["tcp://a\t:1", "tls://a\n:1", "tcp://\x1b[2J", "\u202e.json"])
def test_an_address_is_one_line_without_control_characters(study: str, address: str) -> None:
    with pytest.raises(ConfigError, match=r"cluster\.address = '.*': must be tcp://HOST:PORT"):
        find_cluster(address)
    done = CliRunner().invoke(app, ["sweep", study, "--quiet", "--cluster", address])
    assert done.exit_code == 2
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("[" * 100_000, "nested too deeply"),
        ("{", "not valid JSON"),
        ("[]", "has address = None: must be tcp://HOST:PORT"),
        ('{"address": 1}', "has address = 1: must be"),
        ('{"address": "/etc/passwd"}', "has address = '/etc/passwd': must be"),
        ('{"address": "other.json"}', "has address = 'other.json': must be"),
        ('{"address": "tcp://a\\n:1"}', r"cluster.address = 'tcp://a\n:1': must be"),
        (None, "a pipe or a device, not a file"),
    ],
    ids=["deep", "broken", "list", "number", "path", "another file", "line break", "pipe"],
)
def test_a_scheduler_file_is_read_as_every_other(study: str, tmp_path: Path, content: str | None, words: str) -> None:
    path = tmp_path / "scheduler.json"
    if content is None:
        if not hasattr(os, "mkfifo"):
            pytest.skip("Windows has no such pipes")
        os.mkfifo(path)
    else:
        path.write_text(content)
    done = CliRunner().invoke(app, ["sweep", study, "--quiet", "--cluster", str(path)])
    assert done.exit_code == 2, done.output
    assert len(done.stderr.splitlines()) == 1
    assert words in done.stderr


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("walltime", "01:00:00\nid"),
        ("walltime", "01:00:00; id"),
        ("walltime", "tomorrow"),
        ("memory", "2GB\nid"),
        ("memory", "$(id)"),
        ("partition", "long\nid"),
        ("partition", "-wrap=id"),
        ("account", "worms\n#SBATCH --wrap=id"),
        ("interface", "eth0; id"),
        ("interface", "`id`"),
        ("python", "sh -c id"),
        ("python", "python; id;"),
        ("python", "/opt/python\nid"),
        ("python", "$HOME/evil"),
        ("python", "-c"),
        ("directives", ["--constraint=zen4\nid"]),
        ("directives", ["id"]),
        ("directives", ["--comment=`id`"]),
        ("prologue", ["module load python\nid"]),
        ("prologue", ["module load python\x1b[2J"]),
    ],
)
def test_a_field_of_a_job_script_holds_no_more_than_it_should(tmp_path: Path, field: str, value: Any) -> None:
    # TOML and JSON write such texts and lists alike.
    (tmp_path / "job.toml").write_text(f'[cluster]\nkind = "slurm"\n{field} = {json.dumps(value)}\n')
    with pytest.raises(ConfigError, match=rf"cluster\.{field}.*: must be") as refused:
        find_cluster(str(tmp_path / "job.toml"))
    assert str(refused.value).isprintable()


def test_slurm_without_slurm_is_refused_before_anything_is_computed(
    study: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "")
    done = CliRunner().invoke(app, ["sweep", study, "--cluster", "slurm"])
    assert done.exit_code == 2
    assert "cluster 'slurm': there is no program sbatch here" in done.stderr
    assert not Path("sweep").exists()


def test_nobody_without_its_key_joins_the_scheduler_of_slurm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from distributed import Client
    from distributed.comm.core import connect

    monkeypatch.setenv("HOME", str(tmp_path))
    cluster = slurm_cluster(Slurm())
    try:
        own = psutil.Process().net_connections()
        page = cluster.scheduler.http_server.port
        assert {one.laddr.ip for one in own if one.laddr.port == page} == {"127.0.0.1"}
        address = cluster.scheduler_address
        assert address.startswith("tls://")
        for without_key in (address, address.replace("tls://", "tcp://")):
            with pytest.raises((OSError, TypeError)):
                asyncio.run(asyncio.wait_for(connect(without_key, timeout=0.5), 5))
        Client(cluster).close()
        keys = list(tmp_path.glob(".dask-jobqueue*"))
        assert len(keys) == 3
        assert {path.stat().st_mode & 0o077 for path in keys} == {0}
        assert all(f"~/{path.name}" in cluster.job_script() for path in keys)
    finally:
        cluster.close()


CASE = Case(PLANAR, {"duration_s": 0.1})
OTHER = Case(PLANAR, {"duration_s": 0.1, "body.gain": 0.9})


class Away(Workers):
    """A worker on another machine that sends what the test says."""

    retries = 2

    def __init__(self, sent: object) -> None:
        self.sent = sent

    def slots(self) -> int:
        return 1

    def submit(self, task: Work) -> Result:
        future = Future[Any]()
        future.set_result(self.sent)
        return future

    def close(self, *, drop: bool) -> None:
        """Nothing to let go."""


def task_elsewhere(store: Store, case: Case) -> Task:
    """A run for a worker that does not see the store's folder."""
    return Task(store.path(case).name, case.config.model_dump_json(), own_code(), "elsewhere", "mark", store._keep)


@pytest.fixture(scope="module")
def sent(tmp_path_factory: pytest.TempPathFactory) -> list[bytes]:
    """What an honest worker sends of `CASE` and of `OTHER`."""
    store = Store(tmp_path_factory.mktemp("runs"))
    found = []
    for case in (CASE, OTHER):
        content = attempt(task_elsewhere(store, case))
        assert content is not None
        found.append(content)
    return found


def test_what_an_honest_worker_sends_is_kept(tmp_path: Path, sent: list[bytes]) -> None:
    store = Store(tmp_path, Away(sent[0]))
    store.compute([CASE])
    assert {path.name for path in store.path(CASE).iterdir()} == {FILE_NAME, OUTCOME_NAME}


@pytest.mark.parametrize(
    "forged",
    [
        lambda content, other: {"../../evil": content},
        lambda content, other: {"/annelid-evil": content},
        lambda content, other: {FILE_NAME: content, OUTCOME_NAME: b"{}"},
        lambda content, other: [content],
        lambda content, other: bytearray(content),
        lambda content, other: "text",
        lambda content, other: b"no run",
        lambda content, other: content[:-1],
        lambda content, other: b"",
        lambda content, other: other,
        lambda content, other: {},
        lambda content, other: 5,
    ],
)
def test_what_a_worker_sends_is_the_run_that_was_asked_for(forged: Any, tmp_path: Path, sent: list[bytes]) -> None:
    store = Store(tmp_path / "a" / "b" / "runs", Away(forged(*sent)))
    with pytest.raises(ClusterError, match="a worker sent"):
        store.compute([CASE], failed={})
    assert [path.name for path in tmp_path.rglob("*")] == ["a", "b", "runs", ".store"]
    assert not Path("/annelid-evil").exists()


def with_field(path: str, value: Any) -> Callable[[dict[str, Any]], object]:
    *sections, field = path.split(".")
    return lambda content: reduce(dict.__getitem__, sections, content).__setitem__(field, value)


@pytest.mark.parametrize(
    "change",
    [
        with_field("summary.duration_s", "evil"),
        with_field("summary.duration_s", float("nan")),
        with_field("summary.order", ["1"]),
        with_field("summary", 5),
        with_field("message", {"a": 1}),
        with_field("rhythm.verdict", "fine"),
        with_field("rhythm.order", 5),
        with_field("gait.energy", [1]),
        with_field("holds", [{}]),
        with_field("cpu_time_s", True),
        with_field("more", 1),
        dict.clear,
    ],
)
def test_numbers_that_a_worker_sends_are_numbers(change: Any, tmp_path: Path, outcomes: bytes) -> None:
    content = json.loads(outcomes)
    change(content)
    refused_numbers(tmp_path, json.dumps(content).encode())


@pytest.mark.parametrize("content", [b"[" * 100_000, b"\xff\xfe", b"[1, 2]", b"x" * (MOST_BYTES[OUTCOME_NAME] + 1)])
def test_texts_that_are_no_numbers_are_refused(content: bytes, tmp_path: Path) -> None:
    refused_numbers(tmp_path, content)


def refused_numbers(folder: Path, content: bytes) -> None:
    store = Store(folder, Away(content), keep="outcomes")
    with pytest.raises(ClusterError, match=r"a worker sent a") as refused:
        store.compute([CASE], failed={})
    assert len(str(refused.value)) < 500
    assert [path.name for path in folder.iterdir()] == [".store"]


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """What an honest worker sends of `CASE` where only numbers are kept."""
    store = Store(tmp_path_factory.mktemp("numbers"), keep="outcomes")
    content = attempt(task_elsewhere(store, CASE))
    assert content is not None
    return content


def test_honest_numbers_are_kept(tmp_path: Path, outcomes: bytes) -> None:
    store = Store(tmp_path, Away(outcomes), keep="outcomes")
    assert store.compute([CASE])[case_key(CASE)].summary.duration_s == pytest.approx(0.1)
