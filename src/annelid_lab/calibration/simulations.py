"""What is done to worms in experiments: computed in parallel, each kept in a file named by all that it depends on."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from annelid.config import RunConfig
from annelid.errors import ClusterError, SimulationStopped
from annelid.experiment import StudyProgress, answers, physics_fingerprint, room_of
from annelid.output import whole_file
from annelid_lab.calibration.base import Found, Test

MOST_BYTES = 2**28
"""Of what a worker may send of one test."""


@dataclass(frozen=True)
class Simulation:
    """A test of a worm, as a worker takes it."""

    test: Test
    config: str
    """As JSON."""

    def __call__(self) -> bytes:
        """Computes it; the arrays come as an archive of numpy."""
        file = io.BytesIO()
        arrays = self.test.run(RunConfig.model_validate_json(self.config))
        np.savez(file, **arrays)  # pyright: ignore[reportArgumentType]
        return file.getvalue()

    @property
    def name(self) -> str:
        """Names its file: the test, the worm, and the code that computes them."""
        text = f"{self.test!r}{self.config}{physics_fingerprint(room_of(type(self.test)))}"
        return f"{type(self.test).__name__}-{hashlib.sha256(text.encode()).hexdigest()[:16]}.npz"


class Simulations:
    """A folder of what tests of worms gave."""

    def __init__(
        self, folder: Path | None = None, executor: Executor | None = None, progress: StudyProgress | None = None
    ) -> None:
        """Opens it.

        Args:
            folder: Where they are kept; None for in memory only.
            executor: Who computes; None for this process.
            progress: Called with the stage as tests go on.
        """
        self._folder, self._executor, self._progress = folder, executor, progress
        self._known: dict[str, Found | None] = {}
        self.computed = 0
        """How many tests were computed, and not found."""

    def compute(self, wanted: Sequence[tuple[Test, RunConfig]], stage: str) -> list[Found | None]:
        """Computes those that are not there yet; None for a worm that gives way.

        Args:
            wanted: The tests, each with its worm.
            stage: What is done, in a few words.

        Raises:
            AnnelidError: A test cannot be done. Others are kept.
        """
        tasks = [Simulation(test, config.model_dump_json(exclude={"name", "summary"})) for test, config in wanted]
        names = [task.name for task in tasks]
        missing = {name: task for name, task in zip(names, tasks, strict=True) if not self._find(name)}
        left = list(missing.items())
        if left:
            self._report(stage, 0, len(left))
        calls = ((task,) for _, task in left)
        given = enumerate(task for _, task in left) if self._executor is None else answers(self._executor, calls)
        for done, (number, answer) in enumerate(given, start=1):
            try:
                content = answer()
            except SimulationStopped:
                self._known[left[number][0]] = None
                continue
            if not isinstance(content, bytes) or len(content) > MOST_BYTES:
                raise ClusterError("a worker sent no arrays, or too many")
            self._keep(left[number][0], content)
            self._report(stage, done, len(left))
        self.computed += len(left)
        return [self._known[name] for name in names]

    def _report(self, stage: str, done: int, total: int) -> None:
        if self._progress is not None:
            self._progress(stage, done, total, done / total)

    def _keep(self, name: str, content: bytes) -> None:
        if self._folder is not None:
            self._folder.mkdir(parents=True, exist_ok=True)
            with whole_file(self._folder / name) as draft:
                draft.write_bytes(content)
        with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
            self._known[name] = dict(arrays)

    def _find(self, name: str) -> bool:
        if name in self._known:
            return True
        if self._folder is None or not (self._folder / name).is_file():
            return False
        try:
            with np.load(self._folder / name, allow_pickle=False) as arrays:
                self._known[name] = dict(arrays)
        except (OSError, ValueError, EOFError):
            return False
        return True
