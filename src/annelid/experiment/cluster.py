"""Workers of a Dask scheduler: one that is running elsewhere, or one in this process whose workers are jobs of Slurm.

Only here is Dask imported. Runs are handed over one a worker (`store.py`), results are published by the workers
themselves where they see the store's folder, and come home over the network where they do not (`attempt.py`).
"""

from __future__ import annotations

import asyncio
import logging
import shutil
import time
import warnings
from collections.abc import Callable
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any

from annelid.config import cluster as settings
from annelid.errors import ClusterError, MissingDependency, RunKilled
from annelid.experiment.attempt import Work, attempt
from annelid.experiment.workers import Processes, Result, Workers

if TYPE_CHECKING:
    from distributed import Client

MISSING = "runs on a cluster need Dask: install it with  pip install 'annelid[sweep]'"
MISSING_SLURM = "jobs of Slurm need dask-jobqueue and cryptography: install them with  pip install 'annelid[slurm]'"
SBATCH = "sbatch"
FRESH_S = 0.3
"""For how long the number of workers is not asked again, s."""
HANDSHAKE_S = 5.0
"""For how long a scheduler may take that has been reached, s."""


def workers_of(cluster: settings.Cluster, jobs: int | None = None) -> Workers:
    """Returns the workers of a cluster, which start with the first run.

    ``jobs`` is how many, instead of what the cluster says; it has no effect on a scheduler elsewhere.
    """
    if isinstance(cluster, settings.Pool):
        return Processes(jobs or cluster.workers, cluster.retries)
    if isinstance(cluster, settings.Scheduler):
        return DaskWorkers(cluster.retries, cluster.address, partial(_joined, cluster))
    if shutil.which(SBATCH) is None:
        raise ClusterError(
            f"cluster 'slurm': there is no program {SBATCH} here: call this where jobs of Slurm are submitted, or "
            "take --cluster processes"
        )
    return DaskWorkers(cluster.retries, "in this process", partial(_submitted, cluster, jobs or cluster.jobs))


class DaskWorkers(Workers):
    """The workers of one scheduler, which is joined with the first run."""

    def __init__(self, retries: int, where: str, join: Callable[[], Client]) -> None:
        self.retries, self._where, self._join = retries, where, join
        self._client: Client | None = None
        self._counted: tuple[float, int] = (-float("inf"), 0)

    def slots(self) -> int:
        """Returns how many workers there are now; 0 while the scheduler is gone."""
        if self._client is None:
            try:
                import distributed  # noqa: F401
            except ImportError:
                raise MissingDependency(MISSING) from None
            self._client = self._join()
        if self._client.status == "closed":
            raise ClusterError(
                f"the scheduler {self._where} is gone: finished runs are kept, so call again once it is back"
            )
        now = time.monotonic()
        if now - self._counted[0] > FRESH_S:
            n_workers = 0
            if self._client.status == "running":
                # The scheduler may be going away right now: the connection breaks, or the client's own loop has ended.
                with suppress(OSError, RuntimeError, CancelledError):
                    n_workers = len(_threads_of(self._client))
            self._counted = now, n_workers
        return self._counted[1]

    def submit(self, task: Work) -> Result:
        """Has a run computed by one of the workers."""
        assert self._client is not None
        return self._client.get_executor(pure=False).submit(attempt, task)

    def explained(self, error: Exception) -> Exception:
        """Says in a sentence what Dask says of a run whose workers died."""
        from distributed import KilledWorker

        if isinstance(error, KilledWorker):
            return RunKilled(
                f"its worker died {error.allowed_failures + 1} times: killed, out of memory or out of time"
            )
        return error

    def close(self, *, drop: bool) -> None:
        """Leaves the scheduler, and ends it where it was started for this."""
        if self._client is not None:
            if drop and self._client.status == "running":
                self._client.cancel(list(self._client.futures), force=True)
            cluster: Any = self._client.cluster
            self._client.close(timeout=2)
            self._client = None
            if cluster is not None:
                cluster.close()


def _joined(cluster: settings.Scheduler) -> Client:
    """Returns a client of a scheduler that is running somewhere."""
    from distributed import Client

    address, seconds = cluster.found(), cluster.reconnect_s
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        # In a thread, since this one may have a loop that runs, as in a notebook.
        with ThreadPoolExecutor(1) as thread:
            thread.submit(asyncio.run, _greet_scheduler(address, seconds)).result()
        client = Client(address, timeout=seconds)
    except (OSError, ValueError, TypeError) as error:
        raise ClusterError(f"no scheduler answers at {address}: start one with  dask scheduler") from error
    threads, start = _threads_of(client).values(), f"dask worker {cluster.address} --nworkers auto --nthreads 1"
    if not threads:
        warnings.warn(f"{cluster.address} has no workers yet: waiting for  {start}", stacklevel=2)
    if any(count > 1 for count in threads):
        warnings.warn(
            f"workers of {cluster.address} have several threads, of which runs use one: start them with {start}",
            stacklevel=2,
        )
    return client


def _submitted(of: settings.Slurm, jobs: int) -> Client:
    """Starts a scheduler in this process whose workers are jobs of Slurm; a job that ends is followed by another."""
    from dask import config
    from distributed import Client

    taken_over = {
        "distributed.scheduler.allowed-failures": of.retries,
        # One run a worker: one that dies is counted against its own run only.
        "distributed.scheduler.worker-saturation": 1.0,
        "distributed.worker.daemon": True,
    }
    with config.set(taken_over):
        cluster = slurm_cluster(of)
    try:
        cluster.adapt(minimum_jobs=jobs, maximum_jobs=jobs)
        return Client(cluster)
    except BaseException:
        cluster.close()
        raise


def slurm_cluster(of: settings.Slurm) -> Any:
    """Starts a scheduler in this process that can submit jobs to Slurm; none is submitted yet.

    It must be reached over the network, so it speaks TLS with a key made for this one process, which the jobs read from
    files in the user's home folder that nobody else may read.
    """
    try:
        from dask_jobqueue.slurm import SLURMCluster
        from distributed import Security

        security = Security.temporary()
    except ImportError:
        raise MissingDependency(MISSING_SLURM) from None
    optional: dict[str, Any] = {"python": of.python, "interface": of.interface}
    return SLURMCluster(
        queue=of.partition,
        account=of.account,
        cores=of.cores,
        processes=of.cores,
        memory=of.memory,
        walltime=of.walltime,
        job_extra_directives=list(of.directives),
        job_script_prologue=list(of.prologue),
        security=security,
        shared_temp_directory="~",
        # The page that says whether a scheduler is well cannot be left out: it is for this machine only.
        scheduler_options={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
        **{name: value for name, value in optional.items() if value is not None},
    )


async def _greet_scheduler(address: str, seconds: float) -> None:
    """Shakes hands with a scheduler: Dask's client would wait for ever for one that accepts and is silent."""
    from distributed import Security
    from distributed.comm.core import connect

    greeting = connect(address, timeout=seconds, **Security().get_connection_args("client"))
    comm = await asyncio.wait_for(greeting, seconds + HANDSHAKE_S)
    comm.abort()


def _threads_of(client: Client) -> dict[str, int]:
    """Number of threads of every worker by its address."""
    threads: Any = client.nthreads()
    return threads
