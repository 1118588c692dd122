"""Runs are kept by all that they depend on, each once and whole, whoever computes them and whatever is killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from annelid.errors import ClusterError, ConfigError, RunKilled
from annelid.experiment.case import Case
from annelid.experiment.executors import Processes
from annelid.experiment.outcome import OUTCOME_NAME, Outcome
from annelid.experiment.store import DRAFTS, Store, attempt, case_key, compute_run, keep_outcome, new_draft
from annelid.simulation.runfile import FILE_NAME, open_run
from annelid_studies.standard_cases import PLANAR, RODS


def planar(seed: int = 0, duration_s: float = 0.1) -> Case:
    return Case(PLANAR, {"duration_s": duration_s, "seed": seed})


IMPOSSIBLE = Case(PLANAR, {"body.gain": 1e4, "duration_s": 0.1})
"""The plant refuses it, the configuration does not."""


class Here(Executor):
    """Computes in this process, but loses what the test says, or has another disk."""

    def __init__(self, *script: str) -> None:
        self.keys: list[str] = []
        self._script = [*script]

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.keys.append(args[0])
        future = Future[Any]()
        what = self._script.pop(0) if self._script else ""
        if what == "lost":
            future.cancel()
            future.set_running_or_notify_cancel()
            return future
        if what == "elsewhere":
            args = (*args[:2], args[2].replace("/riddle", "/elsewhere/riddle"))
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


def folders(store: Store) -> list[Path]:
    """Folders of runs, those of attempts too."""
    return [path for path in store.folder.iterdir() if path.is_dir()]


@pytest.fixture
def single(tmp_path: Path) -> Store:
    """A store with one run, computed in this process."""
    store = Store(tmp_path / "runs", Here())
    store.compute([planar()])
    return store


def test_every_case_is_computed_once_and_a_second_call_computes_nothing(tmp_path: Path) -> None:
    here, told = Here(), list[tuple[str, int, int, float]]()
    store = Store(tmp_path / "runs", here, progress=lambda *state: told.append(state))
    cases = [planar(0), planar(3), planar(1, 0.2)]
    first = store.compute([*cases, planar(0)], "runs")
    assert list(first) == [*map(case_key, cases)]
    assert here.keys == [case_key(cases[i]) for i in (0, 2, 1)], "behind the first the longest comes first"
    assert [state[:3] for state in told] == [("runs", done, 3) for done in range(4)]
    assert told[2][3] == pytest.approx(3 / 4)
    assert store.compute(cases) == first
    assert len(here.keys) == len(folders(store)) == 3
    assert float(store.run(planar(0)).data["time"][-1]) == pytest.approx(0.1, abs=0.01)
    assert planar(2) not in store
    with pytest.raises(KeyError, match="seed=2"):
        store[planar(2)]


def test_a_killed_run_is_computed_again_and_what_it_left_goes(single: Store) -> None:
    folder, before = single.path(planar()), lasting(single[planar()])
    (folder / OUTCOME_NAME).unlink()
    run_file = folder / FILE_NAME
    run_file.write_bytes(run_file.read_bytes()[: run_file.stat().st_size // 2])
    draft = new_draft(folder)
    draft.mkdir()
    (draft / FILE_NAME).write_bytes(b"half")
    assert planar() not in single
    assert lasting(single.compute([planar()])[case_key(planar())]) == before
    assert not list(single.folder.glob(DRAFTS))


def lasting(outcome: Outcome) -> Mapping[str, object]:
    """The numbers of a run but for its speed."""
    return outcome.summary.to_dict() | {"real_time_factor": None}


@pytest.mark.parametrize("damage", [lambda text: '{"reader": "older", "summary": {"gone": 1}}', lambda text: text[:99]])
def test_an_outcome_that_is_damaged_or_of_other_code_is_read_again(single: Store, damage: Callable[[str], str]) -> None:
    path = single.path(planar()) / OUTCOME_NAME
    fresh = path.read_text()
    path.write_text(damage(fresh))
    assert planar() in single
    assert json.loads(path.read_text()) == json.loads(fresh)


def test_a_run_that_a_guard_stops_is_an_outcome(tmp_path: Path) -> None:
    case = Case(RODS, {"duration_s": 0.3, "guard.edge_strain": 1e-6})
    compute_run(case.config, tmp_path)
    assert keep_outcome(open_run(tmp_path)).message
    assert json.loads((tmp_path / OUTCOME_NAME).read_text())["message"]


def test_a_store_may_keep_the_numbers_only(tmp_path: Path) -> None:
    store = Store(tmp_path, Here(), keep="outcomes")
    store.compute([planar()])
    assert sorted(path.name for path in store.path(planar()).iterdir()) == [OUTCOME_NAME]
    assert planar() in store
    whole = Store(tmp_path, Here())
    assert planar() not in whole
    whole.compute([planar()])
    assert whole.run(planar()).status == "complete"
    assert len(folders(whole)) == 1


def test_a_run_that_two_stores_compute_at_once_is_there_once(tmp_path: Path) -> None:
    stores = [Store(tmp_path, Here()) for _ in range(2)]
    with ThreadPoolExecutor(2) as both:
        first, second = both.map(lambda store: store.compute([planar(seed) for seed in range(3)]), stores)
    assert first.keys() == second.keys()
    assert {path.name for path in folders(stores[0])} == {stores[0].path(planar(seed)).name for seed in range(3)}


def test_a_worker_with_other_code_or_without_the_folder_is_refused(tmp_path: Path) -> None:
    text = planar().config.model_dump_json()
    with pytest.raises(ClusterError, match="has other code: install the same versions"):
        attempt("another key", text, str(tmp_path / "run"))
    with pytest.raises(ClusterError, match=r"does not see .*elsewhere: name a folder with -o that all machines share"):
        attempt(case_key(planar()), text, str(tmp_path / "elsewhere" / "run"))
    assert not list(tmp_path.iterdir())
    (tmp_path / "elsewhere").mkdir()
    with pytest.raises(ClusterError, match="a worker's run is not in"):
        Store(tmp_path, Here("elsewhere")).compute([planar()])


def test_workers_that_are_lost_end_the_call_and_what_is_done_is_kept(tmp_path: Path) -> None:
    with pytest.raises(ClusterError, match="workers are gone: what is done is kept"):
        Store(tmp_path, Here("", "lost")).finish([planar(0), planar(1)], "runs")
    assert [case in Store(tmp_path) for case in (planar(0), planar(1))] == [True, False]


def test_an_error_ends_its_own_run_and_is_told_in_the_order_of_the_cases(tmp_path: Path) -> None:
    told: list[str] = []
    cases = [Case(PLANAR, {"body.gain": -1.0}), IMPOSSIBLE, planar()]
    done = Store(tmp_path, Here()).finish(cases, "runs", progress=lambda stage, *_: told.append(stage))
    assert [(one.status, one.refused) for one in done] == [("failed", True), ("failed", False), ("complete", False)]
    assert "body.gain = -1.0" in done[0].reason
    assert "overshoot" in done[1].reason
    assert done[2].reason == ""
    assert told[-1] == "runs, 1 failed"
    with pytest.raises(ConfigError, match="overshoot"):
        Store(tmp_path, Here()).compute([IMPOSSIBLE])


def test_another_configuration_or_other_code_is_another_run(monkeypatch: pytest.MonkeyPatch) -> None:
    keys = {case_key(planar()), case_key(planar(1)), case_key(planar().but({"body.gain": 1.31}))}
    assert case_key(Case(PLANAR, {"seed": 0, "duration_s": 0.1})) == case_key(planar())
    assert case_key(Case(PLANAR, {"summary": "other words"})) == case_key(Case(PLANAR))
    monkeypatch.setattr("annelid.experiment.fingerprint.physics_fingerprint", lambda *_: "changed")
    assert len(keys | {case_key(planar())}) == 4


def killed(times: int, folder: str) -> str:
    """Kills its process so many times."""
    for i in range(times):
        try:
            Path(folder, f"{i}").touch(exist_ok=False)
        except FileExistsError:
            continue
        os.kill(os.getpid(), signal.SIGKILL if hasattr(signal, "SIGKILL") else signal.SIGTERM)
    return os.environ["OMP_NUM_THREADS"]


def test_a_killed_process_costs_its_own_call_and_computes_on_one_thread(tmp_path: Path) -> None:
    for name in ("once", "ever"):
        (tmp_path / name).mkdir()
    with Processes(2) as two:
        once, ever = two.submit(killed, 1, str(tmp_path / "once")), two.submit(killed, 9, str(tmp_path / "ever"))
        assert once.result(60) == "1"
        with pytest.raises(RunKilled, match="its worker died 3 times"):
            ever.result(60)


INTERRUPTED = """
import sys
from pathlib import Path
from annelid.experiment import Case, Processes, Store

long = {"duration_s": 3000.0, "record.signals_interval_s": 1.0}
cases = [Case("riddle2022-planar", changes) for changes in ({"duration_s": 0.1, "seed": 0}, long)]
if __name__ == "__main__":
    try:
        with Processes(2) as two:
            Store(Path(sys.argv[1]), two).compute(cases)
    except KeyboardInterrupt:
        sys.exit(130)
"""


def test_ctrl_c_keeps_finished_runs(tmp_path: Path) -> None:
    script = tmp_path / "study.py"
    script.write_text(INTERRUPTED)
    store = Store(tmp_path / "runs")
    study = subprocess.Popen([sys.executable, script, store.folder], start_new_session=True, stderr=subprocess.DEVNULL)
    try:
        end = time.monotonic() + 100.0
        while not (planar() in store and len(list(store.folder.glob(f"*/{FILE_NAME}"))) == 2):
            assert time.monotonic() < end
            time.sleep(0.05)
        os.killpg(study.pid, signal.SIGINT)
        assert study.wait(10.0) == 130
    finally:
        if study.poll() is None:
            os.killpg(study.pid, signal.SIGKILL)
            study.wait(60)
    assert [path.parent for path in store.folder.glob(f"*/{OUTCOME_NAME}")] == [store.path(planar())]


def test_a_script_that_forgets_its_guard_is_told_so(tmp_path: Path) -> None:
    (tmp_path / "study.py").write_text(INTERRUPTED.replace('__name__ == "__main__"', "True"))
    words = [sys.executable, str(tmp_path / "study.py"), str(tmp_path / "runs")]
    done = subprocess.run(words, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 1
    assert 'not below  if __name__ == "__main__":' in done.stderr.splitlines()[-1]
