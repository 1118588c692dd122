"""The store of runs: computed in parallel, each kept in a folder named by all that it depends on.

A run is there or it is not: a folder gets its name once its outcome is written, which happens last. So a second call
computes nothing, a killed one loses the runs in progress and no other, and changed code makes new folders.
"""

from __future__ import annotations

import hashlib
import shutil
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping, MutableMapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from annelid.config.kinds import kinds_in
from annelid.errors import AnnelidError, ConfigError
from annelid.experiment.attempt import (
    DRAFTS,
    MARK_NAME,
    Keep,
    Task,
    fetch_results,
    own_code,
    run_of_draft,
    stored_outcome,
)
from annelid.experiment.case import Case
from annelid.experiment.fingerprint import foreign_code, physics_fingerprint
from annelid.experiment.outcome import Outcome
from annelid.experiment.progress import StudyProgress, in_stage
from annelid.experiment.workers import Processes, Workers
from annelid.plausibility import refuse_nonsense
from annelid.simulation.runfile import Run, open_run

Progress = Callable[[int, int, float], object]
"""Called with the number of runs done, their total, and the share of the work that is done."""


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
        self, folder: Path, workers: Workers | None = None, keep: Keep = "runs", progress: StudyProgress | None = None
    ) -> None:
        """Opens a store.

        Args:
            folder: The folder.
            workers: Who computes its runs; None for a process of this machine on every core.
            keep: ``"runs"``, or ``"outcomes"`` to keep their numbers only.
            progress: Called as runs go on, with what `compute` names their stage; None for nothing.
        """
        self.folder, self.workers, self.progress = folder, workers, progress
        self._keep: Keep = keep

    def path(self, case: Case) -> Path:
        """Folder of a case's run."""
        return self.folder / f"{case.stem}-{case_key(case)}"

    def __contains__(self, case: Case) -> bool:
        return self._stored(case) is not None

    def __getitem__(self, case: Case) -> Outcome:
        """Outcome of a case that has been computed; a KeyError if it has not."""
        found = self._stored(case)
        if found is None:
            raise KeyError(case.command)
        return found

    def run(self, case: Case) -> Run:
        """Opens the run of a case that has been computed.

        Raises:
            RunFileError: It has not, or its file is damaged.
        """
        return open_run(self.path(case))

    def _stored(self, case: Case) -> Outcome | None:
        return stored_outcome(self.path(case), self._keep)

    def compute(
        self,
        cases: Iterable[Case],
        stage: str = "",
        *,
        progress: Progress | None = None,
        failed: MutableMapping[str, Exception] | None = None,
        meanwhile: Callable[[], object] = lambda: None,
    ) -> Mapping[str, Outcome]:
        """Runs those cases that are not there yet, the longest first, several at a time.

        Args:
            cases: The cases; a case given twice runs once.
            stage: What is done, in a few words, for the store's ``progress``.
            progress: Called at the start and after every run, in place of the store's own.
            failed: Takes the error of every run that cannot be computed, by its `case_key`; None has the first such run
                end the call.
            meanwhile: Called in this process once the first runs are under way, or where all are there.

        Returns:
            The outcome by its `case_key` of every case but those that failed, in the order of the cases.

        Raises:
            AnnelidError: A case cannot be built, or its file cannot be written, and ``failed`` is None. A run that a
                guard stops is no error: its outcome says so.
            ClusterError: The workers are lost for good, or have other code. Finished runs are kept.
            KeyboardInterrupt: Runs in progress are dropped, all others kept.
        """
        wanted = {case_key(case): case for case in cases}
        found = {key: stored for key, case in wanted.items() if (stored := self._stored(case)) is not None}
        missing = sorted((wanted[key] for key in wanted if key not in found), key=lambda case: -case.cost_s)
        total_s = sum(case.cost_s for case in missing)
        left_s, done = total_s, len(found)
        progress = progress or in_stage(self.progress, stage)

        def report() -> None:
            if progress is not None:
                progress(done, len(wanted), 1.0 - left_s / total_s if total_s else 1.0)

        report()
        if not missing:
            meanwhile()
            return found
        with Processes() if self.workers is None else nullcontext(self.workers) as workers:
            for case, error in self._computed(workers, missing, meanwhile):
                left_s, done = left_s - case.cost_s, done + 1
                if error is None:
                    found[case_key(case)] = self[case]
                elif failed is None:
                    raise error
                else:
                    failed[case_key(case)] = error
                report()
        # What killed attempts have left of runs that are there now.
        for draft in self.folder.glob(DRAFTS):
            if stored_outcome(run_of_draft(draft), self._keep) is not None:
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
        report: StudyProgress = progress or self.progress or (lambda *_: None)
        refused: dict[int, ConfigError] = {}
        for i, case in enumerate(cases):
            report("checking the runs", i, len(cases), i / len(cases))
            try:
                refuse_nonsense(case.config)
            except ConfigError as error:
                refused[i] = error
        failed: dict[str, Exception] = {}
        outcomes = self.compute(
            [case for i, case in enumerate(cases) if i not in refused],
            progress=lambda *state: report(f"{stage}, {len(failed)} failed" if failed else stage, *state),
            failed=failed,
        )
        return [
            Done(None, refused[i], True)
            if i in refused
            else Done(outcomes.get(case_key(case)), failed.get(case_key(case)))
            for i, case in enumerate(cases)
        ]

    def _computed(
        self, workers: Workers, missing: Sequence[Case], meanwhile: Callable[[], object]
    ) -> Iterator[tuple[Case, Exception | None]]:
        """Has runs computed, and yields each as it is there or has failed."""
        self.folder.mkdir(parents=True, exist_ok=True)
        marked = self.folder / MARK_NAME
        if not marked.exists():
            marked.write_text(uuid.uuid4().hex, encoding="utf-8")
        home, mark, code = str(self.folder.resolve()), marked.read_text(encoding="utf-8"), own_code()

        def task_of(number: int) -> Task:
            case = missing[number]
            return Task(self.path(case).name, case.config.model_dump_json(), code, home, mark, self._keep)

        def take(number: int, content: bytes | None) -> None:
            if content is not None:
                fetch_results(content, self.path(missing[number]), missing[number].config, self._keep)

        for number, error in workers.computed(len(missing), task_of, take, meanwhile):
            yield missing[number], error


def case_key(case: Case) -> str:
    """Digest of all that a run depends on: its configuration, the code that computes it, and the engine."""
    foreign = "".join(sorted(foreign_code(kind) for kind in kinds_in(case.config)))
    text = case.config.model_dump_json(exclude={"summary", "published"}) + physics_fingerprint() + foreign
    return hashlib.sha256(text.encode()).hexdigest()[:16]
