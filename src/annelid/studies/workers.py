"""Who computes the runs of a store: processes of this machine, or the workers of a cluster (`studies/cluster.py`)."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from types import TracebackType
from typing import Self

from annelid.studies.attempt import Files, Task, attempt

Result = Future[Files | None]

_SINGLE_THREADED = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


class Workers(ABC):
    """Workers that each compute one run at a time; used as a context, at whose end they are let go.

    Attributes:
        retries: How often a run is tried again whose files could not be written.
    """

    retries: int = 0

    @abstractmethod
    def slots(self) -> int:
        """Returns how many runs can be under way now.

        Raises:
            ClusterError: The workers are lost for good.
        """

    @abstractmethod
    def submit(self, task: Task) -> Result:
        """Has a run computed; a future that ends cancelled was lost on the way and may be submitted again."""

    def explained(self, error: Exception) -> Exception:
        """Returns an error of a run as one that a user can read."""
        return error

    @abstractmethod
    def close(self, *, drop: bool) -> None:
        """Lets the workers go, ``drop`` with what they are at."""

    def __enter__(self) -> Self:
        """Begins to use them."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Lets them go."""
        self.close(drop=error is not None)


class Processes(Workers):
    """Processes of this machine, started with the first run."""

    def __init__(self, jobs: int | None = None) -> None:
        """Prepares.

        Args:
            jobs: How many; default: one a core.
        """
        self._jobs = jobs or os.cpu_count() or 1
        self._pool: ProcessPoolExecutor | None = None

    def slots(self) -> int:
        """Returns how many runs can be under way."""
        return self._jobs

    def submit(self, task: Task) -> Result:
        """Has a run computed."""
        if self._pool is None:
            self._pool = ProcessPoolExecutor(self._jobs, mp_context=get_context("spawn"))
        # The pool starts its processes as it takes work.
        with _single_threaded():
            return self._pool.submit(attempt, task)

    def close(self, *, drop: bool) -> None:
        """Ends the processes."""
        if self._pool is not None:
            self._pool.shutdown(wait=not drop, cancel_futures=drop)
            self._pool = None


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
