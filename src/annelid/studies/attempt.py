"""One attempt at a run, by a worker on any machine: computed in a folder of its own, then published whole.

Two workers may compute the same run, as where a cluster takes a slow one for dead. The first to publish wins, and the
other's folder is dropped, so that a run is there once and never half.
"""

from __future__ import annotations

import platform
import shutil
import tempfile
import uuid
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from annelid.config import RunConfig
from annelid.errors import ClusterError, RunFileError, SimulationStopped
from annelid.simulation.runfile import FILE_NAME, open_run
from annelid.studies.fingerprint import READERS, code_fingerprint, physics_fingerprint
from annelid.studies.outcome import Outcome, outcome, read_outcome, write_outcome

OUTCOME_NAME = "outcome.json"
MARK_NAME = ".store"
"""A store's mark: a worker that reads it in the store's folder shares the file system."""
DRAFTS = ".*.part"
"""Folders of attempts."""

Keep = Literal["runs", "outcomes"]
"""What is kept of every run: all of its files, or its numbers only."""
Files = dict[str, bytes]


@dataclass(frozen=True, slots=True)
class Task:
    """What a worker must know of a run, in plain words.

    Attributes:
        name: Of the run's folder in the store.
        config: The configuration as JSON.
        code: Digests of the code that computes runs and that reads them.
        home: The store's folder, absolute.
        mark: The store's mark.
        keep: What is kept.
    """

    name: str
    config: str
    code: tuple[str, str]
    home: str
    mark: str
    keep: Keep


def own_code() -> tuple[str, str]:
    """Digests of this process' code that computes runs and that reads them."""
    return physics_fingerprint(), code_fingerprint(*READERS)


def attempt(task: Task) -> Files | None:
    """Computes a run and publishes it in its store.

    Returns:
        None; or the contents of the run's files by name, where the store's folder is not that of this machine.

    Raises:
        ClusterError: This worker has other code.
        AnnelidError: The run cannot be built or written. A run that a guard stops is no error.
        KeyboardInterrupt: It was interrupted.
    """
    if task.code != own_code():
        raise ClusterError(
            f"the worker on {platform.node()} has other code: install the same versions of annelid, mujoco-core and "
            "numpy as on this machine"
        )
    home = Path(task.home)
    folder = home / task.name
    if not _is_shared(home, task.mark):
        with tempfile.TemporaryDirectory(prefix="annelid-") as away:
            compute_run(RunConfig.model_validate_json(task.config), Path(away), task.keep)
            return {file.name: file.read_bytes() for file in Path(away).iterdir()}
    draft = new_draft(folder)
    try:
        compute_run(RunConfig.model_validate_json(task.config), draft, task.keep)
        publish(draft, folder, task.keep)
    except OSError:
        # Where another attempt has won, this one's folder may have been cleared away under it.
        if stored_outcome(folder, task.keep) is None:
            raise
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    return None


def bring_home(files: Files, folder: Path, keep: Keep) -> None:
    """Publishes the files of a run that was computed on another machine."""
    draft = new_draft(folder)
    try:
        draft.mkdir()
        for name, content in files.items():
            (draft / name).write_bytes(content)
        publish(draft, folder, keep)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def compute_run(config: RunConfig, folder: Path, keep: Keep = "runs") -> None:
    """Runs a configuration into a folder and writes its outcome beside it; of ``"outcomes"`` only that is left."""
    from annelid.simulation.loop import simulate

    # A run that a guard stops is a finding, not a failure.
    with suppress(SimulationStopped):
        if simulate(config, folder, progress=False, overwrite=True).status == "interrupted":
            raise KeyboardInterrupt
    keep_outcome(folder)
    if keep == "outcomes":
        (folder / FILE_NAME).unlink()


def keep_outcome(folder: Path) -> Outcome:
    """Reads the outcome of the run in a folder, and writes it beside the run."""
    read = outcome(open_run(folder))
    draft = folder / f".{OUTCOME_NAME}.{uuid.uuid4().hex[:8]}.part"
    write_outcome(read, draft, code_fingerprint(*READERS))
    draft.replace(folder / OUTCOME_NAME)
    return read


def stored_outcome(folder: Path, keep: Keep = "runs") -> Outcome | None:
    """Returns the outcome of the run in a folder, read again where its file is damaged or other code has read the run.

    Returns:
        The outcome; None where there is no whole run, or not all of it that is to be kept.
    """
    if keep == "runs" and not (folder / FILE_NAME).exists():
        return None
    try:
        return read_outcome(folder / OUTCOME_NAME, code_fingerprint(*READERS))
    except OSError:
        return None
    except ValueError:
        with suppress(RunFileError):
            return keep_outcome(folder)
        return None


def publish(draft: Path, folder: Path, keep: Keep) -> None:
    """Gives a whole draft its name, unless another attempt came first."""
    try:
        draft.rename(folder)
    except OSError:
        if not folder.exists():
            raise
        if stored_outcome(folder, keep) is not None:
            return
        # What is there has no outcome that counts: an older annelid was killed over it, or it is not to be kept so.
        aside = new_draft(folder)
        folder.rename(aside)
        draft.rename(folder)
        shutil.rmtree(aside, ignore_errors=True)


def new_draft(folder: Path) -> Path:
    """Returns a name for an attempt's own folder beside that of the run."""
    return folder.with_name(f".{folder.name}.{uuid.uuid4().hex[:8]}.part")


def run_of_draft(draft: Path) -> Path:
    """Returns the folder of the run that a draft is of."""
    return draft.with_name(draft.name.removeprefix(".").rsplit(".", 2)[0])


def _is_shared(home: Path, mark: str) -> bool:
    try:
        return (home / MARK_NAME).read_text(encoding="utf-8") == mark
    except OSError:
        return False
