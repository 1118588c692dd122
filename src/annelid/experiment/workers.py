"""Who computes the runs of a store: processes of this machine, or the workers of a cluster (`cluster.py`)."""

from __future__ import annotations

import os
import signal
import time
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any, Self

from annelid.errors import ClusterError, RunFileError, RunKilled
from annelid.experiment.attempt import Work, attempt
from annelid.experiment.lifeline import end_after
from annelid.simulation.progress import Interruption

Result = Future[bytes | None]

POLL_S = 0.5
"""How often workers are looked for that have come or gone, s."""
STARTS = 5
"""Processes that are tried for one run before they count as unable to start."""
_SINGLE_THREADED = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


class Workers(ABC):
    """Workers that each compute one run at a time; used as a context, at whose end they are let go."""

    retries: int = 0
    """How often a run is tried again whose files could not be written."""

    @abstractmethod
    def slots(self) -> int:
        """Returns how many runs can be under way now.

        Raises:
            ClusterError: The workers are lost for good.
        """

    @abstractmethod
    def submit(self, task: Work) -> Result:
        """Has a run computed; a future that ends cancelled was lost and may be submitted again."""

    def explained(self, error: Exception) -> Exception:
        """Returns an error of a run as one that a user can read."""
        return error

    def computed(
        self,
        n: int,
        task_of: Callable[[int], Work],
        take: Callable[[int, bytes | None], object],
        meanwhile: Callable[[], object] = lambda: None,
    ) -> Iterator[tuple[int, Exception | None]]:
        """Has n tasks computed, and yields the number of each as what it sends is taken, or with its error.

        Args:
            n: How many there are.
            task_of: Gives a task by its number, from 0.
            take: Keeps what a task sent.
            meanwhile: Called in this process once the first tasks are under way.

        Raises:
            ClusterError: The workers are lost for good, or have other code.
        """
        # No more than the workers take at once: what lies in their own queue could not be taken back, and a worker that
        # dies would be counted against the runs behind the one that killed it.
        waiting, running, tries, begun = deque(range(n)), dict[Result, int](), Counter[int](), False
        while waiting or running:
            while waiting and len(running) < self.slots():
                number = waiting.popleft()
                running[self.submit(task_of(number))] = number
            if not begun:
                begun = True
                meanwhile()
            if not running:
                time.sleep(POLL_S)
            done, _ = wait(running, POLL_S, FIRST_COMPLETED)
            for future in done:
                number = running.pop(future)
                try:
                    take(number, future.result())
                except CancelledError:
                    waiting.append(number)
                except ClusterError:
                    raise
                except ImportError as error:
                    raise ClusterError(f"a worker cannot import annelid: install it there too ({error})") from error
                except Exception as error:
                    if isinstance(error, RunFileError | OSError | BrokenExecutor) and tries[number] < self.retries:
                        tries[number] += 1
                        waiting.append(number)
                    else:
                        yield number, self.explained(error)
                else:
                    yield number, None

    @abstractmethod
    def close(self, *, drop: bool) -> None:
        """Lets the workers go, ``drop`` with what they are at."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        self.close(drop=error is not None)


@dataclass
class _Process:
    """A process with a queue of its own: should it die, only its own run is lost."""

    pool: ProcessPoolExecutor
    ready: Future[int]
    """Done once it has started."""
    result: Result | None = None
    """Of its last run."""


class Processes(Workers):
    """Processes of this machine, started as runs come; one that dies is replaced, and all end with this process.

    They are reached through pipes: no port is opened.
    """

    def __init__(self, jobs: int | None = None, retries: int = 2) -> None:
        """Takes how many processes, by default one a core; a run is also tried again whose process died."""
        self.retries = retries
        self._jobs = jobs or os.cpu_count() or 1
        self._processes: list[_Process] = []
        self._lifeline: tuple[Connection, Connection] | None = None

    def slots(self) -> int:
        """Returns how many runs can be under way."""
        return self._jobs

    def submit(self, task: Work) -> Result:
        """Has a run computed by a process that is free."""
        # The pool starts its process as it takes work.
        with _single_threaded():
            for _ in range(STARTS):
                free = self._free() or self._start()
                try:
                    result = free.result = free.pool.submit(attempt, task)
                    # One that dies at this very moment may lose the run without a word, so that it would never end
                    # (CPython 3.11); a pool that still takes a call reports what it has taken before.
                    free.pool.submit(os.getpid)
                except BrokenExecutor:
                    # It was killed while it had nothing to do.
                    self._bury(free)
                else:
                    return result
        raise ClusterError(f"{STARTS} processes ended as they started: killed, or out of memory (try fewer --jobs)")

    def explained(self, error: Exception) -> Exception:
        """Says in a sentence that the process of a run has died."""
        if isinstance(error, BrokenExecutor):
            return RunKilled(f"its worker died {self.retries + 1} times: killed, or out of memory (try fewer --jobs)")
        return error

    def close(self, *, drop: bool) -> None:
        """Ends the processes."""
        reader, writer = self._lifeline or (None, None)
        if drop and writer is not None:
            writer.close()
        for one in self._processes:
            one.pool.shutdown(wait=True, cancel_futures=drop)
        if reader is not None and writer is not None:
            reader.close()
            writer.close()
        self._processes, self._lifeline = [], None

    def _free(self) -> _Process | None:
        """Returns a process with nothing to do; one whose run has killed it is buried."""
        free = next((one for one in self._processes if one.result is None or one.result.done()), None)
        if free is not None and free.result is not None and isinstance(free.result.exception(), BrokenExecutor):
            self._bury(free)
            return None
        return free

    def _start(self) -> _Process:
        context = get_context("spawn")
        if self._lifeline is None:
            self._lifeline = context.Pipe(duplex=False)
        pool = ProcessPoolExecutor(1, context, end_after, (self._lifeline[0].recv_bytes,))
        # Interrupted halfway, it would leave a process that complains of it.
        with Interruption() as interruption:
            self._processes.append(_Process(pool, pool.submit(os.getpid)))
        if interruption.requested is not None:
            signal.raise_signal(signal.Signals[interruption.requested])
        return self._processes[-1]

    def _bury(self, dead: _Process) -> None:
        self._processes.remove(dead)
        dead.pool.shutdown(wait=True)
        if dead.ready.exception() is not None:
            raise ClusterError(
                "the processes that compute runs end as they start: in a script, call this below "
                'if __name__ == "__main__":'
            )


@contextmanager
def _single_threaded() -> Iterator[None]:
    """Has the workers' linear algebra keep to one thread each: the runs are what is parallel."""
    added = _SINGLE_THREADED.keys() - os.environ.keys()
    os.environ.update({name: _SINGLE_THREADED[name] for name in added})
    try:
        yield
    finally:
        for name in added:
            os.environ.pop(name, None)
