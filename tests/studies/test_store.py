from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from annelid.errors import ConfigError
from annelid.experiment import store as module
from annelid.experiment import workers
from annelid.experiment.attempt import OUTCOME_NAME, compute_run, keep_outcome
from annelid.experiment.case import Case
from annelid.experiment.outcome import Outcome
from annelid.experiment.store import Store, case_key
from annelid.experiment.workers import Processes
from annelid.simulation.runfile import FILE_NAME, open_run
from annelid_studies.worms import PLANAR, RODS


def planar(seed: int = 0, duration_s: float = 0.2) -> Case:
    return Case(PLANAR, {"duration_s": duration_s, "seed": seed})


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """A store with two runs, computed by two processes."""
    store = Store(tmp_path_factory.mktemp("store") / "runs")
    with Processes(2) as two:
        Store(store.folder, two).compute([planar(0), planar(1), planar(0)])
    return store


@pytest.fixture
def single(tmp_path: Path) -> Store:
    """A store with one run, computed in this process."""
    store = Store(tmp_path / "runs")
    compute_run(planar().config, store.path(planar()))
    return store


@pytest.fixture
def no_simulation(monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes every attempt to compute a run an error."""

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a run was computed")

    monkeypatch.setattr(workers, "ProcessPoolExecutor", refuse)


def test_every_case_is_computed_once(filled: Store) -> None:
    assert len(list(filled.folder.glob("[!.]*"))) == 2
    assert planar(0) in filled
    assert planar(2) not in filled
    assert filled[planar(1)].path == filled.path(planar(1))
    assert float(filled.run(planar(0)).data["time"][-1]) == pytest.approx(0.2, abs=0.01)


def test_a_case_that_is_not_there_is_a_key_error(filled: Store) -> None:
    with pytest.raises(KeyError, match="seed=2"):
        filled[planar(2)]


@pytest.mark.usefixtures("no_simulation")
def test_a_second_call_computes_nothing(filled: Store) -> None:
    calls: list[tuple[int, int, float]] = []
    outcomes = Store(filled.folder).compute([planar(0), planar(1)], progress=lambda *state: calls.append(state))
    assert set(outcomes) == {case_key(planar(0)), case_key(planar(1))}
    assert calls == [(2, 2, 1.0)]


def test_a_killed_run_is_computed_again(single: Store) -> None:
    case = planar()
    folder = single.path(case)
    before = lasting(single[case])
    (folder / OUTCOME_NAME).unlink()
    run_file = folder / FILE_NAME
    run_file.write_bytes(run_file.read_bytes()[: run_file.stat().st_size // 2])
    assert case not in single
    assert lasting(single.compute([case])[case_key(case)]) == before


def lasting(outcome: Outcome) -> Mapping[str, object]:
    """The numbers of a run but for its speed."""
    return outcome.summary.to_dict() | {"real_time_factor": None}


@pytest.mark.usefixtures("no_simulation")
def test_an_outcome_of_another_reader_is_read_again(single: Store) -> None:
    path = single.path(planar()) / OUTCOME_NAME
    fresh = json.loads(path.read_text())
    path.write_text(json.dumps({"reader": "older", "summary": {"gone": 1}}))
    assert len(single.compute([planar()])) == 1
    assert json.loads(path.read_text()) == fresh


@pytest.mark.usefixtures("no_simulation")
def test_a_damaged_outcome_is_read_again(single: Store) -> None:
    path = single.path(planar()) / OUTCOME_NAME
    fresh = path.read_text()
    path.write_text(fresh[: len(fresh) // 2])
    assert planar() in single
    assert path.read_text() == fresh


def test_another_configuration_or_other_code_is_another_run(monkeypatch: pytest.MonkeyPatch) -> None:
    case = planar()
    keys = {case_key(case), case_key(case.but({"seed": 1})), case_key(case.but({"body.gain": 1.31}))}
    monkeypatch.setattr(module, "physics_fingerprint", lambda: "changed")
    assert len(keys | {case_key(case)}) == 4


def test_the_key_is_that_of_the_configuration_not_of_its_words() -> None:
    assert case_key(Case(PLANAR, {"seed": 0, "duration_s": 0.2})) == case_key(planar())
    assert case_key(Case(PLANAR, {"summary": "other words"})) == case_key(Case(PLANAR))


def test_a_run_that_a_guard_stops_is_an_outcome(tmp_path: Path) -> None:
    case = Case(RODS, {"duration_s": 0.3, "guard.edge_strain": 1e-6})
    folder = tmp_path / "stopped"
    compute_run(case.config, folder)
    stopped = keep_outcome(open_run(folder))
    assert stopped.message
    assert json.loads((folder / OUTCOME_NAME).read_text())["message"] == stopped.message


def test_a_workers_refusal_reaches_the_caller_and_keeps_what_is_done(tmp_path: Path) -> None:
    store = Store(tmp_path)
    # The plant refuses this, not the configuration.
    impossible = Case(PLANAR, {"body.gain": 1e4, "duration_s": 0.1})
    with Processes(1) as one, pytest.raises(ConfigError, match="overshoot"):
        Store(tmp_path, one).compute([planar(), impossible])
    assert planar() in store
    assert impossible not in store


INTERRUPTED = """
import sys
from pathlib import Path
from annelid.experiment.case import Case
from annelid_studies.worms import PLANAR
from annelid.experiment.outcome import Outcome
from annelid.experiment.store import Store
from annelid.experiment.workers import Processes

if __name__ == "__main__":
    cases = [Case(PLANAR, {"duration_s": 0.2}), Case(PLANAR, {"duration_s": 3000.0, "record.signals_interval_s": 1.0})]
    try:
        with Processes(2) as workers:
            Store(Path(sys.argv[1]), workers).compute(cases)
    except KeyboardInterrupt:
        sys.exit(130)
"""


def test_ctrl_c_keeps_finished_runs(tmp_path: Path) -> None:
    script = tmp_path / "study.py"
    script.write_text(INTERRUPTED)
    store, short = Store(tmp_path / "runs"), Case(PLANAR, {"duration_s": 0.2})
    study = subprocess.Popen([sys.executable, script, store.folder], start_new_session=True, stderr=subprocess.DEVNULL)
    try:
        assert within(100.0, lambda: short in store and len(list(store.folder.glob(f"*/{FILE_NAME}"))) == 2)
        os.killpg(study.pid, signal.SIGINT)
        assert study.wait(10.0) == 130
    finally:
        if study.poll() is None:
            os.killpg(study.pid, signal.SIGKILL)
            study.wait(60)
    assert short in store
    assert [path.parent for path in store.folder.glob(f"*/{OUTCOME_NAME}")] == [store.path(short)]


def within(limit_s: float, condition: Callable[[], bool]) -> bool:
    end = time.monotonic() + limit_s
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.05)
    return True
