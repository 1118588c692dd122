"""The store of runs: maps configurations to kept results by the digest of all that these depend on.

Any `concurrent.futures.Executor` computes them. A run is computed in a folder of its own, which gets its name once
its outcome is written, which happens last. So a second call computes nothing, a killed one loses the runs in progress
and no other, and changed code makes new folders.
"""

from __future__ import annotations

import platform
import shutil
import uuid
from collections.abc import Iterable, Iterator, Mapping, MutableMapping, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from annelid.config import RunConfig
from annelid.errors import AnnelidError, ClusterError, ConfigError, RunFileError, SimulationStopped
from annelid.experiment.case import Case
from annelid.experiment.executors import answers, workers
from annelid.experiment.fingerprint import run_key
from annelid.experiment.outcome import OUTCOME_NAME, Outcome, outcome, read_outcome, write_outcome
from annelid.experiment.progress import StudyProgress
from annelid.plausibility import refuse_nonsense
from annelid.simulation.loop import simulate
from annelid.simulation.runfile import FILE_NAME, Run, open_run

SHARE = "name a folder with -o that all machines share under the same path"
DRAFTS = ".*.part"
"""Folders of runs in progress."""


@dataclass(frozen=True, slots=True)
class Done:
    """What became of a case: what is kept of its run, or why there is nothing."""

    outcome: Outcome | None
    error: Exception | None = None
    refused: bool = False
    """Whether the error was known before anything ran."""

    @property
    def status(self) -> Literal["complete", "stopped", "failed"]:
        """How it went: "stopped" is ended by a guard before its time, "failed" could not be computed."""
        if self.outcome is None:
            return "failed"
        return "stopped" if self.outcome.message else "complete"

    @property
    def reason(self) -> str:
        """Why it is not complete, in a sentence; empty if it is."""
        if self.outcome is not None:
            return self.outcome.message
        text = " ".join(str(self.error).split())
        return text if isinstance(self.error, AnnelidError) and text else f"{type(self.error).__name__}: {text}"

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is doubtful about its run, a sentence each."""
        return () if self.outcome is None else self.outcome.summary.warnings


class Store:
    """A folder of runs, which is made when the first run is computed."""

    def __init__(
        self,
        folder: Path,
        executor: Executor | None = None,
        keep: Literal["runs", "outcomes"] = "runs",
        progress: StudyProgress | None = None,
    ) -> None:
        """Opens a store.

        Args:
            folder: The folder.
            executor: Who computes its runs; None for a process of this machine on every core.
            keep: ``"runs"``, or ``"outcomes"`` to keep their numbers only.
            progress: Called as runs go on; None for nothing.
        """
        self.folder, self.executor, self._whole = folder, executor, keep == "runs"
        self.progress: StudyProgress = progress or (lambda *_: None)

    def path(self, case: Case) -> Path:
        """Folder of a case's run."""
        return self.folder / f"{case.stem}-{case_key(case)}"

    def __contains__(self, case: Case) -> bool:
        return self._kept(case) is not None

    def __getitem__(self, case: Case) -> Outcome:
        """Outcome of a case that has been computed; a KeyError if it has not."""
        found = self._kept(case)
        if found is None:
            raise KeyError(case.command)
        return found

    def run(self, case: Case) -> Run:
        """Opens the run of a case that has been computed.

        Raises:
            RunFileError: It has not, or its file is damaged.
        """
        return open_run(self.path(case))

    def compute(
        self,
        cases: Iterable[Case],
        stage: str = "",
        *,
        progress: StudyProgress | None = None,
        failed: MutableMapping[str, Exception] | None = None,
    ) -> Mapping[str, Outcome]:
        """Runs those cases that are not there yet: the first one first, then the longest.

        Args:
            cases: The cases; a case given twice runs once.
            stage: What is done, in a few words.
            progress: Called at the start and after every run, in place of the store's own.
            failed: Takes the error of every run that cannot be computed, by its `case_key`; None has the first such run
                end the call.

        Returns:
            The outcome by its `case_key` of every case but those that failed, in the order of the cases.

        Raises:
            AnnelidError: A case cannot be built, or its file cannot be written, and ``failed`` is None. A run that a
                guard stops is no error: its outcome says so.
            ClusterError: The workers are lost for good, have other code, or do not share the folder. Finished runs are
                kept.
            KeyboardInterrupt: Runs in progress are dropped, all others kept.
        """
        wanted = {case_key(case): case for case in cases}
        found = {key: kept for key, case in wanted.items() if (kept := self._kept(case)) is not None}
        first = next(iter(wanted), None)
        missing = [key for key in wanted if key not in found]
        missing.sort(key=lambda key: (key != first, -wanted[key].cost_s))
        errors = {} if failed is None else failed
        left_s = total_s = sum(wanted[key].cost_s for key in missing)

        def report() -> None:
            text = f"{stage}, {len(errors)} failed" if errors else stage
            share = 1.0 - left_s / total_s if total_s else 1.0
            (progress or self.progress)(text, len(found) + len(errors), len(wanted), share)

        report()
        if not missing:
            return found
        self.folder.mkdir(parents=True, exist_ok=True)
        places = {key: str(self.folder.resolve() / self.path(wanted[key]).name) for key in missing}
        calls = ((attempt, key, wanted[key].config.model_dump_json(), places[key]) for key in missing)
        with workers(self.executor) as executor:
            for number, answer in answers(executor, calls):
                key, case = missing[number], wanted[missing[number]]
                try:
                    answer()
                    if (kept := self._kept(case)) is None:
                        raise ClusterError(f"a worker's run is not in {self.folder}: {SHARE}")
                    found[key] = kept
                    if not self._whole:
                        (self.path(case) / FILE_NAME).unlink(missing_ok=True)
                except Exception as error:
                    if failed is None or isinstance(error, ClusterError):
                        raise
                    errors[key] = error
                left_s -= case.cost_s
                report()
        # What killed attempts have left of runs that are there now.
        for draft in self.folder.glob(DRAFTS):
            name = draft.name.removeprefix(".").rsplit(".", 2)[0]
            if stored_outcome(draft.with_name(name), whole=self._whole) is not None:
                shutil.rmtree(draft, ignore_errors=True)
        return {key: found[key] for key in wanted if key in found}

    def finish(self, cases: Sequence[Case], stage: str, *, progress: StudyProgress | None = None) -> list[Done]:
        """Runs cases as `compute` does, but for those that mean nothing, and goes on where runs fail.

        Args:
            cases: The cases.
            stage: What is done, in a few words.
            progress: Called as cases are checked and run, in place of the store's own.

        Returns:
            What became of every case, in their order.
        """
        refused: dict[int, ConfigError] = {}
        failed: dict[str, Exception] = {}
        for i, case in enumerate(cases):
            (progress or self.progress)("checking the settings", i, len(cases), i / len(cases))
            try:
                refuse_nonsense(case.config)
            except ConfigError as error:
                refused[i] = error
        usable = [case for i, case in enumerate(cases) if i not in refused]
        outcomes = self.compute(usable, stage, progress=progress, failed=failed)
        return [
            Done(None, refused[i], True)
            if i in refused
            else Done(outcomes.get(case_key(case)), failed.get(case_key(case)))
            for i, case in enumerate(cases)
        ]

    def _kept(self, case: Case) -> Outcome | None:
        return stored_outcome(self.path(case), whole=self._whole)


def case_key(case: Case) -> str:
    """Digest of all that a case's run depends on (`fingerprint.run_key`)."""
    return run_key(case.config)


def attempt(key: str, config_json: str, folder: str) -> None:
    """Computes a run in a worker and publishes it in its store.

    A run that a guard stops is no error; an interrupted one is a KeyboardInterrupt.

    Args:
        key: The run's key.
        config_json: Its configuration.
        folder: Where it goes, absolute.

    Raises:
        ClusterError: This process has other code, or does not see the store's folder.
    """
    config, home = RunConfig.model_validate_json(config_json), Path(folder)
    if run_key(config) != key:
        raise ClusterError(
            f"the worker on {platform.node()} has other code: install the same versions of Python, annelid, "
            "mujoco-core and numpy as on this machine"
        )
    if not home.parent.is_dir():
        raise ClusterError(f"the worker on {platform.node()} does not see {home.parent}: {SHARE}")
    try:
        with _draft_of(home) as draft:
            compute_run(config, draft)
    except (OSError, RunFileError):
        # Where another attempt has won, this one's folder may have been cleared away under it.
        if stored_outcome(home) is None:
            raise


def compute_run(config: RunConfig, folder: Path) -> None:
    """Runs a configuration into a folder and writes its outcome beside it."""
    try:
        run = simulate(config, folder, progress=False, overwrite=True)
    except SimulationStopped:
        # A run that a guard stops is a finding, not a failure.
        run = open_run(folder)
    if run.status == "interrupted":
        raise KeyboardInterrupt
    keep_outcome(run)


def keep_outcome(run: Run) -> Outcome:
    """Reads the outcome of a run, and writes it beside the run."""
    read, path = outcome(run), run.path.with_name(OUTCOME_NAME)
    draft = new_draft(path)
    write_outcome(read, draft)
    draft.replace(path)
    return read


def stored_outcome(folder: Path, *, whole: bool = True) -> Outcome | None:
    """Returns the outcome of a folder's run; None where there is none, or, if it must be whole, no run beside it.

    It is read again where its file is damaged or other code has read the run.
    """
    if whole and not (folder / FILE_NAME).exists():
        return None
    with suppress(OSError, RunFileError):
        try:
            return read_outcome(folder / OUTCOME_NAME)
        except ValueError:
            return keep_outcome(open_run(folder))
    return None


@contextmanager
def _draft_of(folder: Path) -> Iterator[Path]:
    """Gives a folder that gets a run's name if the block ends well, unless another came first, and is gone else."""
    draft = new_draft(folder)
    try:
        yield draft
        try:
            draft.rename(folder)
        except OSError:
            if stored_outcome(folder) is None:
                # What is there is no whole run, as where only its numbers were kept.
                folder.rename(aside := new_draft(folder))
                draft.rename(folder)
                shutil.rmtree(aside, ignore_errors=True)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def new_draft(path: Path) -> Path:
    """Returns a name for an attempt's own file or folder beside that which it is of."""
    return path.with_name(f".{path.name}.{uuid.uuid4().hex[:8]}.part")
