"""Runs on workers that come, die and are lost: each is there once, and what cannot be computed says why."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future, process
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from annelid.config.cluster import Pool, Scheduler, Slurm, find_cluster
from annelid.errors import ClusterError, ConfigError, MissingDependency, RunKilled
from annelid.experiment.attempt import (
    DRAFTS,
    OUTCOME_NAME,
    Task,
    Work,
    attempt,
    fetch_results,
    new_draft,
    own_code,
    publish,
)
from annelid.experiment.case import Case
from annelid.experiment.cluster import slurm_cluster, workers_of
from annelid.experiment.store import Store, case_key
from annelid.experiment.workers import Processes, Result, Workers
from annelid.simulation.runfile import FILE_NAME
from annelid_studies.worms import PLANAR


def planar(seed: int = 0, duration_s: float = 0.1) -> Case:
    return Case(PLANAR, {"duration_s": duration_s, "seed": seed})


IMPOSSIBLE = Case(PLANAR, {"body.gain": 1e4, "duration_s": 0.1})
"""The plant refuses it, the configuration does not."""


def task_of(store: Store, case: Case, mark: str = "mark", keep: str = "runs") -> Task:
    store.folder.mkdir(parents=True, exist_ok=True)
    (store.folder / ".store").write_text("mark")
    name, config = store.path(case).name, case.config.model_dump_json()
    return Task(name, config, own_code(), str(store.folder), mark, keep)  # type: ignore[arg-type]


def folders(store: Store) -> list[Path]:
    """Folders of runs, those of attempts too."""
    return [path for path in store.folder.iterdir() if path.is_dir()]


class Here(Workers):
    """Computes in this process, and loses or breaks what the test says."""

    def __init__(self, script: list[str], retries: int = 0) -> None:
        self.retries = retries
        self.tasks: list[Task] = []
        self._script = script

    def slots(self) -> int:
        if self._script and self._script[0] == "gone":
            self._script.pop(0)
            return 0
        if self._script and self._script[0] == "lost":
            raise ClusterError("the scheduler is gone")
        return 2

    def submit(self, task: Work) -> Result:
        assert isinstance(task, Task)
        self.tasks.append(task)
        future = Future[bytes | None]()
        what = self._script.pop(0) if self._script else ""
        if what == "cancelled":
            future.cancel()
            future.set_running_or_notify_cancel()
        elif what == "disk":
            future.set_exception(OSError("no space left on device"))
        else:
            try:
                future.set_result(attempt(task if what != "away" else replace(task, mark="another machine's")))
            except ConfigError as error:
                future.set_exception(error)
        return future

    def close(self, *, drop: bool) -> None:
        """Nothing to let go."""


def test_runs_that_a_scheduler_loses_are_computed_again(tmp_path: Path) -> None:
    workers = Here(["cancelled", "", "gone", "gone", "cancelled"])
    cases = [planar(seed) for seed in range(3)]
    outcomes = Store(tmp_path / "runs", workers).compute(cases)
    assert set(outcomes) == {case_key(case) for case in cases}
    assert Counter(Counter(task.name for task in workers.tasks).values()) == {1: 1, 2: 2}
    assert len(folders(Store(tmp_path / "runs"))) == 3


def test_a_scheduler_that_is_gone_for_good_keeps_what_is_done(tmp_path: Path) -> None:
    store = Store(tmp_path / "runs", Here(["", "cancelled", "lost"]))
    with pytest.raises(ClusterError):
        store.compute([planar(0), planar(1)], failed={})
    assert [case in store for case in (planar(0), planar(1))].count(True) == 1


@pytest.mark.parametrize(("retries", "fails"), [(0, True), (1, False)])
def test_files_that_could_not_be_written_are_tried_again(tmp_path: Path, retries: int, fails: bool) -> None:
    store, failed = Store(tmp_path / "runs", Here(["disk"], retries)), dict[str, Exception]()
    outcomes = store.compute([planar()], failed=failed)
    assert (case_key(planar()) in failed, case_key(planar()) in outcomes) == (fails, not fails)


def test_results_of_another_machine_come_home(tmp_path: Path) -> None:
    here, there = Store(tmp_path / "here", Here([])), Store(tmp_path / "there", Here(["away"]))
    for store in (here, there):
        store.compute([planar()])
    assert len(folders(there)) == 1
    assert there.run(planar()).data.drop_vars("wall_time").equals(here.run(planar()).data.drop_vars("wall_time"))
    assert there[planar()].rhythm == here[planar()].rhythm


@pytest.mark.parametrize("script", [[], ["away"]])
def test_a_store_may_keep_the_numbers_only(tmp_path: Path, script: list[str]) -> None:
    store = Store(tmp_path, Here(script), keep="outcomes")
    store.compute([planar()])
    assert sorted(path.name for path in store.path(planar()).iterdir()) == [OUTCOME_NAME]
    assert planar() in store
    whole = Store(tmp_path, Here([]))
    assert planar() not in whole
    whole.compute([planar()])
    assert whole.run(planar()).status == "complete"
    assert len(folders(whole)) == 1


def test_a_run_that_two_workers_compute_is_there_once(tmp_path: Path) -> None:
    store = Store(tmp_path)
    task = task_of(store, planar())
    attempt(task)
    first = (store.path(planar()) / FILE_NAME).stat().st_mtime_ns
    attempt(task)
    attempt(replace(task, mark="another machine's"))
    content = attempt(replace(task, mark="another machine's"))
    assert content is not None
    fetch_results(content, store.path(planar()), planar().config, "runs")
    assert (store.path(planar()) / FILE_NAME).stat().st_mtime_ns == first
    assert folders(store) == [store.path(planar())]


def test_what_a_killed_worker_left_is_no_run_and_is_replaced(tmp_path: Path) -> None:
    store = Store(tmp_path / "runs")
    attempt(task_of(store, planar()))
    folder = store.path(planar())
    (folder / OUTCOME_NAME).unlink()
    draft = new_draft(folder)
    draft.mkdir()
    (draft / FILE_NAME).write_bytes(b"half")
    assert planar() not in store
    Store(store.folder, Here([])).compute([planar()])
    assert planar() in store
    assert not list(store.folder.glob(DRAFTS))


def test_publishing_into_nowhere_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="No such file"):
        publish(tmp_path / "draft", tmp_path / "gone" / "run", "runs")


def test_a_worker_with_other_code_is_refused(tmp_path: Path) -> None:
    task = replace(task_of(Store(tmp_path), planar()), code=("older", "older"))
    with pytest.raises(ClusterError, match="has other code: install the same versions"):
        attempt(task)


def test_failures_are_told_and_the_others_computed(tmp_path: Path) -> None:
    store, failed = Store(tmp_path), dict[str, Exception]()
    outcomes = Store(tmp_path, Here([])).compute([IMPOSSIBLE, planar()], failed=failed)
    assert planar() in store
    assert set(outcomes) == {case_key(planar())}
    assert isinstance(failed[case_key(IMPOSSIBLE)], ConfigError)
    assert "overshoot" in str(failed[case_key(IMPOSSIBLE)])


def test_what_became_of_every_case_is_told_in_their_order(tmp_path: Path) -> None:
    told: list[str] = []
    cases = [Case(PLANAR, {"body.gain": -1.0}), IMPOSSIBLE, planar()]
    done = Store(tmp_path, Here([])).finish(cases, "runs", progress=lambda stage, *_: told.append(stage))
    assert [(one.status, one.refused) for one in done] == [("failed", True), ("failed", False), ("complete", False)]
    assert "body.gain = -1.0" in done[0].reason
    assert "overshoot" in done[1].reason
    assert done[2].reason == ""
    assert told[-1] == "runs, 1 failed"


def die_at_seed_5(task: Task) -> bytes | None:
    """Attempts a run, but is killed by that of seed 5."""
    if json.loads(task.config)["seed"] == 5:
        os._exit(1)
    return attempt(task)


@pytest.mark.slow
def test_killed_workers_lose_and_double_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("annelid.experiment.workers.attempt", die_at_seed_5)
    cases = [*(planar(seed) for seed in range(12)), IMPOSSIBLE]
    failed: dict[str, Exception] = {}
    killed: list[int] = []

    def kill_one(done: int, total: int, share: float) -> None:
        if done >= 4 and not killed:
            victim = multiprocessing.active_children()[0].pid
            assert victim is not None
            os.kill(victim, signal.SIGKILL)
            killed.append(victim)

    with Processes(2, retries=1) as workers:
        store = Store(tmp_path, workers)
        outcomes = store.compute(cases, progress=kill_one, failed=failed)
    assert killed
    assert set(failed) == {case_key(planar(5)), case_key(IMPOSSIBLE)}
    assert isinstance(failed[case_key(planar(5))], RunKilled)
    assert "died 2 times" in str(failed[case_key(planar(5))])
    assert {case_key(case) for case in cases} == set(outcomes) | set(failed)
    assert {path.name for path in folders(store)} == {outcome.path.name for outcome in outcomes.values()}
    # In the second call what is there is found, and what was killed is computed.
    monkeypatch.undo()
    assert len(Store(tmp_path, Here([])).compute(cases[:-1])) == 12


def thread_settings(task: Task) -> Any:
    return {name: os.environ[name] for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}


def test_a_process_computes_on_one_thread_and_is_replaced_when_killed_idle(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("annelid.experiment.workers.attempt", thread_settings)
    any_task: Any = None
    with Processes(1, retries=0) as workers:
        assert set(workers.submit(any_task).result(30).values()) == {"1"}  # type: ignore[union-attr]
        (child,) = [one for one in multiprocessing.active_children() if one.pid is not None]
        child.kill()
        child.join(30)
        # A run that comes before the pool has noticed is tried again by the store, not by its workers.
        wait_until(lambda: workers._processes[0].pool._broken, 20.0)
        assert set(workers.submit(any_task).result(30).values()) == {"1"}  # type: ignore[union-attr]


def test_a_run_handed_over_while_its_process_dies_is_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("annelid.experiment.workers.attempt", thread_settings)
    any_task: Any = None
    with Processes(1, retries=0) as workers:
        workers.submit(any_task).result(30)
        pool, make = workers._processes[0].pool, process._WorkItem

        def killed_meanwhile(*arguments: Any) -> Any:
            """Stands between the pool's look whether it is broken and its note of the call."""
            monkeypatch.setattr(process, "_WorkItem", make)
            for child in multiprocessing.active_children():
                child.kill()
            # Newer versions of Python keep the pool from finding out in between.
            with suppress(AssertionError):
                wait_until(lambda: pool._broken, 2.0)
            time.sleep(0.2)
            return make(*arguments)

        monkeypatch.setattr(process, "_WorkItem", killed_meanwhile)
        # It ends, either way.
        assert isinstance(workers.submit(any_task).exception(30), BrokenExecutor | None)


def wait_until(condition: Callable[[], object], limit_s: float) -> None:
    end = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end, f"it did not happen within {limit_s:g} s"
        time.sleep(0.01)


def test_without_a_scheduler_one_sentence_says_so() -> None:
    workers = workers_of(Scheduler(address="tcp://127.0.0.1:9", reconnect_s=0.5))
    with pytest.raises(ClusterError, match=r"no scheduler answers at tcp://127\.0\.0\.1:9"):
        workers.slots()
    with pytest.raises(ConfigError, match=r"cannot read the scheduler file nowhere\.json"):
        workers_of(Scheduler(address="nowhere.json")).slots()


@pytest.fixture
def with_sbatch(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine where jobs of Slurm could be submitted, but are not."""
    monkeypatch.setattr("annelid.experiment.cluster.SBATCH", "true")


@pytest.mark.usefixtures("with_sbatch")
@pytest.mark.parametrize("text", ["slurm", "tcp://127.0.0.1:9"])
def test_without_dask_the_line_that_installs_it_is_told(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingDependency, match=r"pip install 'annelid\[sweep\]'"):
        workers_of(find_cluster(text)).slots()


@pytest.mark.usefixtures("with_sbatch")
def test_without_dask_jobqueue_the_line_that_installs_it_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "dask_jobqueue.slurm", None)
    with pytest.raises(MissingDependency, match=r"pip install 'annelid\[slurm\]'"):
        workers_of(Slurm()).slots()


@pytest.mark.usefixtures("with_sbatch")
@pytest.mark.parametrize("text", ["processes", "local", "slurm", "tcp://10.0.0.1:8786", "scheduler.json"])
def test_a_word_names_a_cluster(text: str) -> None:
    kinds = {"processes": Pool, "local": Pool, "slurm": Slurm}
    assert isinstance(find_cluster(text), kinds.get(text, Scheduler))
    assert isinstance(workers_of(find_cluster(text), 1), Workers)


@pytest.fixture
def in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("lokal", "cluster 'lokal': must be one of processes, local, slurm"),
        ("missing.toml", "cannot read"),
        ("empty.toml", r"must have a table \[cluster\]"),
        ("kind.toml", r"cluster.kind = 'pbs': must be one of"),
        ("field.toml", r"unknown field 'cluster.queue'.*Valid here: account"),
        ("address.toml", r"cluster.address = 'here': must be tcp://HOST:PORT"),
    ],
)
@pytest.mark.usefixtures("in_an_empty_folder")
def test_what_names_no_cluster_is_refused(text: str, words: str) -> None:
    Path("empty.toml").write_text("")
    Path("kind.toml").write_text('[cluster]\nkind = "pbs"\n')
    Path("field.toml").write_text('[cluster]\nkind = "slurm"\nqueue = "long"\n')
    Path("address.toml").write_text('[cluster]\nkind = "scheduler"\naddress = "here"\n')
    with pytest.raises(ConfigError, match=words):
        find_cluster(text)


def test_the_job_of_slurm_asks_for_what_the_study_says() -> None:
    of = Slurm(
        jobs=3,
        cores=4,
        memory="8GB",
        walltime="02:00:00",
        partition="long",
        account="worms",
        directives=("--constraint=zen4",),
        prologue=("module load python",),
        python="/opt/python",
    )
    cluster = slurm_cluster(of)
    try:
        script = cluster.job_script()
    finally:
        cluster.close()
    for line in (
        "#SBATCH -p long",
        "#SBATCH -A worms",
        "#SBATCH --cpus-per-task=4",
        "#SBATCH -t 02:00:00",
        "#SBATCH --constraint=zen4",
        "module load python",
    ):
        assert line in script.splitlines()
    assert "/opt/python -m distributed.cli.dask_worker" in script
    assert "--nthreads 1 " in script
    assert "--nworkers 4 " in script
