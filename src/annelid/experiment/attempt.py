"""One attempt at a run, by a worker on any machine: computed in a folder of its own, then published whole.

Two workers may compute the same run, as where a cluster takes a slow one for dead. The first to publish wins, and the
other's folder is dropped, so that a run is there once and never half.
"""

from __future__ import annotations

import platform
import shutil
import tempfile
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from annelid.config import RunConfig
from annelid.errors import MOST_LISTED, ClusterError, RunFileError, SimulationStopped, shortened
from annelid.experiment.fingerprint import READERS, code_fingerprint, physics_fingerprint
from annelid.experiment.outcome import Outcome, outcome, read_outcome, write_outcome
from annelid.simulation.runfile import FILE_NAME, Run, open_run

OUTCOME_NAME = "outcome.json"
MARK_NAME = ".store"
"""A store's mark: a worker that reads it in the store's folder shares the file system."""
DRAFTS = ".*.part"
"""Folders of attempts."""

MOST_BYTES = {FILE_NAME: 4 * 2**30, OUTCOME_NAME: 2**26}
"""How large a file may be that a worker sends, bytes."""

Keep = Literal["runs", "outcomes"]
"""What is kept of every run: all of its files, or its numbers only."""
SENT: Mapping[Keep, str] = {"runs": FILE_NAME, "outcomes": OUTCOME_NAME}
"""The one file that a worker sends: an outcome is read at home where its run is there."""


@dataclass(frozen=True, slots=True)
class Task:
    """What a worker must know of a run, in plain words: the name of its folder, its configuration as JSON, and more."""

    name: str
    config: str
    code: tuple[str, str]
    """Digests of the code that computes runs and that reads them."""
    home: str
    """The store's folder, absolute."""
    mark: str
    keep: Keep


def own_code() -> tuple[str, str]:
    """Digests of this process' code that computes runs and that reads them."""
    return physics_fingerprint(), code_fingerprint(*READERS)


Work = Task | Callable[[], bytes]
"""What a worker computes: a run, or anything else that gives the bytes to send."""


def attempt(task: Work) -> bytes | None:
    """Computes a run and publishes it in its store; returns the file to send where its folder is not on this machine.

    A run that a guard stops is no error; an interrupted one is a KeyboardInterrupt.
    """
    if not isinstance(task, Task):
        return task()
    if task.code != own_code():
        raise ClusterError(
            f"the worker on {platform.node()} has other code: install the same versions of annelid, mujoco-core and "
            "numpy as on this machine"
        )
    home, config = Path(task.home), RunConfig.model_validate_json(task.config)
    try:
        shared = (home / MARK_NAME).read_text(encoding="utf-8") == task.mark
    except OSError:
        shared = False
    if not shared:
        with tempfile.TemporaryDirectory(prefix="annelid-") as away:
            compute_run(config, Path(away), task.keep)
            return (Path(away) / SENT[task.keep]).read_bytes()
    try:
        with _draft_of(home / task.name, task.keep) as draft:
            compute_run(config, draft, task.keep)
    except OSError:
        # Where another attempt has won, this one's folder may have been cleared away under it.
        if stored_outcome(home / task.name, task.keep) is None:
            raise
    return None


def fetch_results(content: bytes, folder: Path, config: RunConfig, keep: Keep) -> None:
    """Publishes a run that a worker on another machine sent, once its file is seen to be whole and of this run."""
    name = SENT[keep]
    if not isinstance(content, bytes) or len(content) > MOST_BYTES[name]:
        raise ClusterError(f"a worker sent a {name} that is no file of at most {MOST_BYTES[name]:,} bytes")
    with _draft_of(folder, keep) as draft:
        draft.mkdir()
        (draft / name).write_bytes(content)
        try:
            if keep == "outcomes":
                read_outcome(draft / name, code_fingerprint(*READERS))
            elif (sent := open_run(draft)).config.model_dump_json() != config.model_dump_json():
                raise ClusterError(f"a worker sent another run in place of {folder.name}: nothing of it is kept")
            else:
                keep_outcome(sent)
        except (OSError, ClusterError):
            raise
        # What a file of others raises depends on what is wrong with it.
        except Exception as error:
            raise ClusterError(
                f"a worker sent a damaged {name} of the run {folder.name}: {shortened(str(error), MOST_LISTED)}"
            ) from None


def compute_run(config: RunConfig, folder: Path, keep: Keep = "runs") -> None:
    """Runs a configuration into a folder and writes its outcome beside it; of ``"outcomes"`` only that is left."""
    from annelid.simulation.loop import simulate

    try:
        run = simulate(config, folder, progress=False, overwrite=True)
    except SimulationStopped:
        # A run that a guard stops is a finding, not a failure.
        run = open_run(folder)
    if run.status == "interrupted":
        raise KeyboardInterrupt
    keep_outcome(run)
    if keep == "outcomes":
        (folder / FILE_NAME).unlink()


def keep_outcome(run: Run) -> Outcome:
    """Reads the outcome of a run, and writes it beside the run."""
    read, folder = outcome(run), run.path.parent
    draft = new_draft(folder / OUTCOME_NAME)
    write_outcome(read, draft, code_fingerprint(*READERS))
    draft.replace(folder / OUTCOME_NAME)
    return read


def stored_outcome(folder: Path, keep: Keep = "runs") -> Outcome | None:
    """Returns the outcome of a folder's run; None where there is no whole run, or not all of it that is to be kept.

    It is read again where its file is damaged or other code has read the run.
    """
    if keep == "runs" and not (folder / FILE_NAME).exists():
        return None
    try:
        return read_outcome(folder / OUTCOME_NAME, code_fingerprint(*READERS))
    except OSError:
        return None
    except ValueError:
        with suppress(RunFileError):
            return keep_outcome(open_run(folder))
        return None


@contextmanager
def _draft_of(folder: Path, keep: Keep) -> Iterator[Path]:
    """Gives an attempt's own folder, which is published if the block ends well and is gone in any case."""
    draft = new_draft(folder)
    try:
        yield draft
        publish(draft, folder, keep)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


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


def new_draft(path: Path) -> Path:
    """Returns a name for an attempt's own file or folder beside that which it is of."""
    return path.with_name(f".{path.name}.{uuid.uuid4().hex[:8]}.part")


def run_of_draft(draft: Path) -> Path:
    """Returns the folder of the run that a draft is of."""
    return draft.with_name(draft.name.removeprefix(".").rsplit(".", 2)[0])
