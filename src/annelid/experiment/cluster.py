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
from abc import abstractmethod
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from annelid.config import cluster as settings
from annelid.errors import ClusterError, MissingDependency, RunKilled
from annelid.experiment.attempt import Task, attempt
from annelid.experiment.workers import Processes, Result, Workers

if TYPE_CHECKING:
    from distributed import Client
    from distributed.deploy.cluster import Cluster

MISSING = "runs on a cluster need Dask: install it with  pip install 'annelid[sweep]'"
MISSING_SLURM = "jobs of Slurm need dask-jobqueue and cryptography: install them with  pip install 'annelid[slurm]'"
SBATCH = "sbatch"
FRESH_S = 0.3
"""For how long the number of workers is not asked again, s."""
HANDSHAKE_S = 5.0
"""For how long a scheduler may take that has been reached, s."""
_NO_DASHBOARD = {"dashboard": False, "dashboard_address": "127.0.0.1:0"}
"""Of the page that tells whether a scheduler is well there is no getting rid: it is for this machine only."""
START_WORKERS = "dask worker ADDRESS --nworkers auto --nthreads 1"


def workers_of(cluster: settings.Cluster, jobs: int | None = None) -> Workers:
    """Returns the workers of a cluster, which start with the first run.

    ``jobs`` is how many, instead of what the cluster says; it has no effect on a scheduler elsewhere.
    """
    if isinstance(cluster, settings.Pool):
        return Processes(jobs or cluster.workers, cluster.retries)
    if isinstance(cluster, settings.Slurm):
        return SlurmWorkers(cluster.model_copy(update={"jobs": jobs or cluster.jobs}))
    return SchedulerWorkers(cluster)


class DaskWorkers(Workers):
    """The workers of one scheduler."""

    def __init__(self, retries: int, where: str) -> None:
        self.retries, self._where = retries, where
        self._client: Client | None = None
        self._counted: tuple[float, int] = (-float("inf"), 0)

    @abstractmethod
    def _join(self) -> Client:
        """Starts or finds the scheduler and returns a client of it."""

    def slots(self) -> int:
        """Returns how many workers there are now; 0 while the scheduler is gone."""
        if self._client is None:
            try:
                import distributed  # noqa: F401
            except ImportError:
                raise MissingDependency(MISSING) from None
            self._client = self._join()
            self._warn_of_workers(_threads_of(self._client))
        if self._client.status == "closed":
            raise ClusterError(
                f"the scheduler {self._where} is gone: finished runs are kept, so call again once it is back"
            )
        now = time.monotonic()
        if now - self._counted[0] > FRESH_S:
            n_workers = 0
            if self._client.status == "running":
                # Else the scheduler is going away right now: the connection breaks, or the client's own loop has ended.
                with suppress(OSError, RuntimeError, CancelledError):
                    n_workers = len(_threads_of(self._client))
            self._counted = now, n_workers
        return self._counted[1]

    def submit(self, task: Task) -> Result:
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
        """Leaves the scheduler, and ends what has been started for it."""
        if self._client is not None:
            if drop and self._client.status == "running":
                self._client.cancel(list(self._client.futures), force=True)
            self._client.close(timeout=2)
            self._client = None

    def _warn_of_workers(self, threads: dict[str, int]) -> None:
        if any(count > 1 for count in threads.values()):
            warnings.warn(
                f"workers of {self._where} have several threads, of which runs use one: start them with "
                f"{START_WORKERS.replace('ADDRESS', self._where)}",
                stacklevel=2,
            )


class SchedulerWorkers(DaskWorkers):
    """The workers of a scheduler that is running somewhere."""

    def __init__(self, cluster: settings.Scheduler) -> None:
        super().__init__(cluster.retries, cluster.address)
        self._cluster = cluster

    def _join(self) -> Client:
        from distributed import Client

        address, seconds = self._cluster.found(), self._cluster.reconnect_s
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        try:
            # In a thread, since this one may have a loop that runs, as in a notebook.
            with ThreadPoolExecutor(1) as thread:
                thread.submit(asyncio.run, _greet_scheduler(address, seconds)).result()
            return Client(address, timeout=seconds)
        except (OSError, ValueError, TypeError) as error:
            raise ClusterError(f"no scheduler answers at {address}: start one with  dask scheduler") from error

    def _warn_of_workers(self, threads: dict[str, int]) -> None:
        if not threads:
            warnings.warn(
                f"{self._where} has no workers yet: waiting for  {START_WORKERS.replace('ADDRESS', self._where)}",
                stacklevel=2,
            )
        super()._warn_of_workers(threads)


class SlurmWorkers(DaskWorkers):
    """Workers in jobs of Slurm, under a scheduler in this process; a job that ends is followed by another."""

    def __init__(self, cluster: settings.Slurm) -> None:
        if shutil.which(SBATCH) is None:
            raise ClusterError(
                f"cluster 'slurm': there is no program {SBATCH} here: call this where jobs of Slurm are submitted, or "
                "take --cluster processes"
            )
        super().__init__(cluster.retries, "in this process")
        self._settings = cluster
        self._cluster: Cluster | None = None

    def _join(self) -> Client:
        from dask import config
        from distributed import Client

        taken_over = {
            "distributed.scheduler.allowed-failures": self.retries,
            # One run a worker: one that dies is counted against its own run only.
            "distributed.scheduler.worker-saturation": 1.0,
            "distributed.worker.daemon": True,
        }
        with config.set(taken_over):
            cluster = self._cluster = slurm_cluster(self._settings)
        cluster.adapt(minimum_jobs=self._settings.jobs, maximum_jobs=self._settings.jobs)
        return Client(cluster)

    def close(self, *, drop: bool) -> None:
        """Ends workers and scheduler."""
        super().close(drop=drop)
        if self._cluster is not None:
            self._cluster.close()
            self._cluster = None


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
        scheduler_options=_NO_DASHBOARD,
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
