"""The store of runs: computed in parallel, each kept in a folder named by all that it depends on.

A run is there or it is not: a folder counts once its outcome is written, which happens last. So a second call
computes nothing, a killed one loses the runs in progress and no other, and changed code makes new folders.
"""

from __future__ import annotations

import hashlib
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path

import annelid
from annelid.errors import SimulationStopped
from annelid.simulation.runfile import Run, open_run
from annelid.studies.case import Work
from annelid.studies.outcome import Outcome, outcome, read_outcome, write_outcome

PHYSICS = ("morphology.py", "clock.py", "arena", "body", "nervous", "control", "planar", "simulation")
"""The rooms whose code a run depends on, beside its configuration."""
READERS = ("analysis", "studies/outcome.py")
"""The code that reads a run's outcome: where it has changed, the outcome is read again, and the run kept."""

OUTCOME_NAME = "outcome.json"

Progress = Callable[[int, int, float], object]
"""Called with the number of runs done, their total, and the share of the work that is done."""

_SINGLE_THREADED = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


class Store:
    """A folder of runs."""

    def __init__(self, folder: Path) -> None:
        """Opens a store; the folder is made when the first run is computed."""
        self.folder = folder

    def path(self, case: Work) -> Path:
        """Folder of a case's run."""
        return self.folder / f"{case.stem}-{case_key(case)}"

    def __contains__(self, case: Work) -> bool:
        return self._stored(case) is not None

    def __getitem__(self, case: Work) -> Outcome:
        """Outcome of a case that has been computed; KeyError if it has not."""
        found = self._stored(case)
        if found is None:
            raise KeyError(case.command)
        return found

    def run(self, case: Work) -> Run:
        """Opens the run of a case that has been computed.

        Raises:
            RunFileError: It has not, or its file is damaged.
        """
        return open_run(self.path(case))

    def _stored(self, case: Work) -> Outcome | None:
        folder = self.path(case)
        try:
            return read_outcome(folder / OUTCOME_NAME, code_fingerprint(*READERS))
        except OSError:
            return None
        except ValueError:
            return keep_outcome(folder)

    def compute(
        self, cases: Iterable[Work], *, jobs: int | None = None, progress: Progress | None = None
    ) -> Mapping[str, Outcome]:
        """Runs those cases that are not there yet, the longest first, several at a time.

        Args:
            cases: The cases; a case given twice runs once.
            jobs: Processes, by default as many as there are cores.
            progress: Called at the start and after every run.

        Returns:
            The outcome of every case by its `case_key`.

        Raises:
            AnnelidError: A case cannot be built, or its file cannot be written. A run that a guard stops is no
                error: its outcome says so.
            KeyboardInterrupt: Runs in progress are dropped, all others kept.
        """
        wanted = {case_key(case): case for case in cases}
        found = {key: stored for key, case in wanted.items() if (stored := self._stored(case)) is not None}
        missing = sorted((wanted[key] for key in wanted if key not in found), key=lambda case: -case.cost_s)
        total_s = sum(case.cost_s for case in missing)
        left_s = total_s

        def report() -> None:
            if progress is not None:
                progress(len(found), len(wanted), 1.0 - left_s / total_s if total_s else 1.0)

        report()
        if not missing:
            return found
        self.folder.mkdir(parents=True, exist_ok=True)
        n_workers = min(jobs or os.cpu_count() or 1, len(missing))
        with _single_threaded(), ProcessPoolExecutor(n_workers, mp_context=get_context("spawn")) as pool:
            # No more than the workers take at once: what lies in the pool's own queue could not be taken back.
            waiting, running = deque(missing), dict[Future[None], Work]()
            try:
                while waiting or running:
                    while waiting and len(running) < n_workers:
                        case = waiting.popleft()
                        running[pool.submit(compute_case, case, self.path(case))] = case
                    done, _ = wait(running, return_when=FIRST_COMPLETED)
                    for future in done:
                        case = running.pop(future)
                        future.result()
                        found[case_key(case)] = self[case]
                        left_s -= case.cost_s
                    report()
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise
        return found


def compute_case(case: Work, folder: Path) -> None:
    """Runs one case into a folder and writes its outcome; what an earlier, killed attempt left is replaced."""
    from annelid.simulation.loop import simulate

    (folder / OUTCOME_NAME).unlink(missing_ok=True)
    # A run that a guard stops is a finding, not a failure.
    with suppress(SimulationStopped):
        if simulate(case.config, folder, progress=False, overwrite=True).status == "interrupted":
            raise KeyboardInterrupt
    keep_outcome(folder)


def keep_outcome(folder: Path) -> Outcome:
    """Reads the outcome of the run in a folder, and writes it beside the run."""
    read = outcome(open_run(folder))
    draft = folder / f".{OUTCOME_NAME}.part"
    write_outcome(read, draft, code_fingerprint(*READERS))
    draft.replace(folder / OUTCOME_NAME)
    return read


def case_key(case: Work) -> str:
    """Digest of all that a run depends on: its configuration, annelid's code, and the engine."""
    text = case.config.model_dump_json(exclude={"summary"}) + physics_fingerprint()
    return hashlib.sha256(text.encode()).hexdigest()[:16]


@cache
def physics_fingerprint() -> str:
    """Digest of the code that computes runs, and of the versions of the engine and numpy."""
    return f"{code_fingerprint(*PHYSICS)} mujoco {version('mujoco-core')} numpy {version('numpy')}"


@cache
def code_fingerprint(*rooms: str) -> str:
    """Digest of annelid's own code in the given rooms, by default in all."""
    source = Path(annelid.__file__).parent
    digest = hashlib.sha256()
    for room in rooms or (".",):
        place = source / room
        for module in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            digest.update(module.relative_to(source).as_posix().encode() + b"\0" + module.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


@contextmanager
def _single_threaded() -> Iterator[None]:
    """Has the workers' linear algebra keep to one thread each: the runs are what is parallel."""
    before = {name: os.environ.get(name) for name in _SINGLE_THREADED}
    os.environ.update({name: value for name, value in _SINGLE_THREADED.items() if before[name] is None})
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
