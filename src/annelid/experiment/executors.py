"""Who computes runs: processes of this machine, or any other executor."""

from __future__ import annotations

import _thread
import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from functools import partial
from multiprocessing import get_context
from queue import Empty, SimpleQueue
from typing import Any

from annelid.errors import ClusterError, RunKilled

ATTEMPTS = 3
"""How often a call is tried whose process dies."""
GRACE_S = 2.0
"""How long a run has to end in good order and to clear away its files, s."""
POLL_S = 0.5
"""How often a caller that waits can be interrupted, s."""
_SINGLE_THREADED = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


def workers(executor: Executor | None, jobs: int | None = None) -> AbstractContextManager[Executor]:
    """Gives an executor that is the caller's own, or else processes of this machine, which end with the block."""
    return Processes(jobs) if executor is None else nullcontext(executor)


def answers(executor: Executor, calls: Iterable[tuple[Any, ...]]) -> Iterator[tuple[int, Callable[[], Any]]]:
    """Has an executor make calls, and yields the number of each, from 0, and what gives its answer as it is there.

    Args:
        executor: Any.
        calls: Functions, each with its arguments.

    Raises:
        ClusterError: By what gives an answer: the executor is lost for good.
    """
    futures, ended = dict[Future[Any], int](), SimpleQueue[Future[Any]]()

    def answer(future: Future[Any]) -> Any:
        try:
            return future.result()
        except (CancelledError, BrokenExecutor) as error:
            raise ClusterError(f"the workers are gone: what is done is kept, so call again ({error})") from error

    try:
        for number, call in enumerate(calls):
            futures[future := executor.submit(*call)] = number
            future.add_done_callback(ended.put)
        while futures:
            with suppress(Empty):
                future = ended.get(timeout=POLL_S)
                yield futures.pop(future), partial(answer, future)
    finally:
        for future in futures:
            future.cancel()


class Processes(ThreadPoolExecutor):
    """Processes that start as calls come and are reached through pipes: no port is opened.

    Each is a pool of its own, fed by a thread: one that dies costs only its own call, which another one tries again.
    Used as a context, they end with it, and an error has them drop what they are at.
    """

    def __init__(self, jobs: int | None = None) -> None:
        """Takes how many processes, by default one a core."""
        super().__init__(jobs or os.cpu_count() or 1)
        self._of_thread, self._starting = threading.local(), threading.Lock()
        self._lifeline, self._kept_open = get_context("spawn").Pipe(duplex=False)
        self._pools: list[ProcessPoolExecutor] = []

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Has a function called by a process; the future's error is `RunKilled` where its processes die."""
        return super().submit(self._call, partial(fn, *args, **kwargs))

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        """Ends the processes."""
        if error is not None:
            self._kept_open.close()
        self.shutdown(cancel_futures=error is not None)
        for pool in self._pools:
            pool.shutdown()
        self._kept_open.close()
        self._lifeline.close()

    def _call(self, call: Callable[[], Any]) -> Any:
        for _ in range(ATTEMPTS):
            if self._kept_open.closed:
                break
            try:
                pool = self._of_thread.pool = getattr(self._of_thread, "pool", None) or self._started()
                result = pool.submit(call)
                # A process that dies at this very moment may lose the call without a word, so that it would never end
                # (CPython 3.11); a pool that still takes a call reports what it has taken before.
                pool.submit(os.getpid)
                return result.result()
            except BrokenExecutor:
                self._of_thread.pool = None
        raise RunKilled(f"its worker died {ATTEMPTS} times: killed, or out of memory (try fewer --jobs)")

    def _started(self) -> ProcessPoolExecutor:
        pool = ProcessPoolExecutor(1, get_context("spawn"), end_after, (self._lifeline.recv_bytes,))
        try:
            with self._starting, _single_threaded():
                self._pools.append(pool)
                ready = pool.submit(os.getpid)
            ready.result()
        # Python itself refuses to start a process in one that has not started yet.
        except RuntimeError as error:
            raise ClusterError(
                "a process for runs ended as it started: it was killed, memory ran out (try fewer --jobs), or a script "
                'calls this not below  if __name__ == "__main__":'
            ) from error
        return pool


@contextmanager
def _single_threaded() -> Iterator[None]:
    """Has processes that start keep their linear algebra to one thread each: the runs are what is parallel."""
    added = _SINGLE_THREADED.keys() - os.environ.keys()
    os.environ.update({name: _SINGLE_THREADED[name] for name in added})
    try:
        yield
    finally:
        for name in added:
            os.environ.pop(name, None)


def end_after(wait: Callable[[], object]) -> None:
    """Has this process end once a call returns or fails, also in the middle of a run.

    Such a call waits for a pipe that only the parent keeps open. Ctrl-C and a terminal that closes reach every process
    of the terminal; here only the parent decides on them.
    """
    for name in ("SIGINT", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    threading.Thread(target=_end, args=(wait,), name="lifeline", daemon=True).start()


def _end(wait: Callable[[], object]) -> None:
    try:
        wait()
    finally:
        # Ends a run in good order (`simulation.progress`), and does nothing outside of one.
        _thread.interrupt_main(signal.SIGTERM)
        time.sleep(GRACE_S)
        os._exit(1)
