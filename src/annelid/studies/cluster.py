"""Workers of a Dask scheduler: in this process for a laptop, running elsewhere, or in jobs of Slurm.

Only here is Dask imported. Runs are handed over one a worker (`studies/store.py`), results are published by the workers
themselves where they see the store's folder, and come home over the network where they do not (`studies/attempt.py`).
"""

from __future__ import annotations

import logging
import os
import time
import warnings
from abc import abstractmethod
from concurrent.futures import CancelledError
from typing import TYPE_CHECKING, Any

from annelid.config import cluster as settings
from annelid.errors import ClusterError, ConfigError, MissingDependency, RunKilled
from annelid.studies.attempt import Task, attempt
from annelid.studies.workers import Processes, Result, Workers

if TYPE_CHECKING:
    from distributed import Client
    from distributed.deploy.cluster import Cluster

MISSING = "runs on a cluster need Dask: install it with  pip install 'annelid[sweep]'"
MISSING_SLURM = "jobs of Slurm need dask-jobqueue: install it with  pip install 'annelid[slurm]'"
FRESH_S = 0.3
"""For how long the number of workers is not asked again, s."""
_NO_DASHBOARD = {"dashboard": False, "dashboard_address": ":0"}
"""Of the page that tells whether a scheduler is well there is no getting rid; at least it takes any free port."""
START_WORKERS = "dask worker ADDRESS --nworkers auto --nthreads 1"


def workers_of(cluster: settings.Cluster, jobs: int | None = None) -> Workers:
    """Returns the workers of a cluster, which start with the first run.

    Args:
        cluster: Where they are.
        jobs: How many, instead of what the cluster says; has no effect on a scheduler elsewhere.
    """
    if isinstance(cluster, settings.Pool):
        return Processes(jobs or cluster.workers)
    if isinstance(cluster, settings.Local):
        return LocalWorkers(jobs or cluster.workers or os.cpu_count() or 1, cluster.retries)
    if isinstance(cluster, settings.Slurm):
        return SlurmWorkers(cluster.model_copy(update={"jobs": jobs or cluster.jobs}))
    return SchedulerWorkers(cluster)


class DaskWorkers(Workers):
    """The workers of one scheduler."""

    def __init__(self, retries: int) -> None:
        """Prepares; nothing starts before the first run."""
        self.retries = retries
        self._client: Client | None = None
        self._counted: tuple[float, int] = (-float("inf"), 0)

    @abstractmethod
    def _join(self) -> Client:
        """Starts or finds the scheduler and returns a client of it."""

    @property
    @abstractmethod
    def _where(self) -> str:
        """Says in words where the scheduler is."""

    def slots(self) -> int:
        """Returns how many workers there are now; 0 while the scheduler is gone.

        Raises:
            ClusterError: It cannot be found, or has been gone for too long.
            MissingDependency: Dask is not installed.
        """
        if self._client is None:
            self._client = self._join()
            self._greet(threads_of(self._client))
        if self._client.status == "closed":
            raise ClusterError(
                f"the scheduler {self._where} is gone: finished runs are kept, so call again once it is back"
            )
        now = time.monotonic()
        if now - self._counted[0] > FRESH_S:
            self._counted = now, self._count(self._client)
        return self._counted[1]

    def submit(self, task: Task) -> Result:
        """Has a run computed by one of the workers."""
        if self._client is None:
            raise ClusterError("no scheduler has been joined yet")
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

    @staticmethod
    def _count(client: Client) -> int:
        if client.status != "running":
            return 0
        try:
            return len(threads_of(client))
        # The scheduler is going away right now: the connection breaks, or the client's own loop has ended.
        except (OSError, RuntimeError, CancelledError):
            return 0

    def _greet(self, threads: dict[str, int]) -> None:
        if any(count > 1 for count in threads.values()):
            warnings.warn(
                f"workers of {self._where} have several threads, of which runs use one: start them with "
                f"{START_WORKERS.replace('ADDRESS', self._where)}",
                stacklevel=2,
            )


class OwnWorkers(DaskWorkers):
    """Workers that are started for this process and end with it, under a scheduler within it."""

    _cluster: Cluster | None = None

    @abstractmethod
    def _start(self) -> Cluster:
        """Starts the scheduler and its workers."""

    @property
    def _where(self) -> str:
        return "in this process"

    def _join(self) -> Client:
        _require_dask()
        from distributed import Client

        with _quiet(self.retries):
            self._cluster = self._start()
        return Client(self._cluster)

    def close(self, *, drop: bool) -> None:
        """Ends workers and scheduler."""
        super().close(drop=drop)
        if self._cluster is not None:
            self._cluster.close()
            self._cluster = None


class LocalWorkers(OwnWorkers):
    """Worker processes of this machine; what dies is started again."""

    def __init__(self, n: int, retries: int) -> None:
        """Prepares ``n`` of them."""
        super().__init__(retries)
        self._n = n

    def _start(self) -> Cluster:
        from distributed import LocalCluster

        start: Any = LocalCluster
        return start(
            n_workers=self._n,
            threads_per_worker=1,
            processes=True,
            scheduler_kwargs=_NO_DASHBOARD,
            # Left to the operating system: Dask would pause workers rather than tell of them.
            memory_limit=0,
            silence_logs=logging.CRITICAL,
        )


class SchedulerWorkers(DaskWorkers):
    """The workers of a scheduler that is running somewhere."""

    def __init__(self, cluster: settings.Scheduler) -> None:
        """Prepares to join it."""
        super().__init__(cluster.retries)
        self._cluster = cluster

    @property
    def _where(self) -> str:
        return self._cluster.address

    def _join(self) -> Client:
        _require_dask()
        from distributed import Client

        address = self._cluster.address
        by: dict[str, Any] = {"scheduler_file": address} if address.endswith(".json") else {"address": address}
        if "scheduler_file" in by and not os.path.exists(address):
            raise ConfigError(f"cluster.address = {address!r}: there is no such scheduler file")
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        try:
            return Client(**by, timeout=self._cluster.reconnect_s)
        except (OSError, ValueError) as error:
            raise ClusterError(f"no scheduler answers at {address}: start one with  dask scheduler") from error

    def _greet(self, threads: dict[str, int]) -> None:
        if not threads:
            warnings.warn(
                f"{self._where} has no workers yet: waiting for  {START_WORKERS.replace('ADDRESS', self._where)}",
                stacklevel=2,
            )
        super()._greet(threads)


class SlurmWorkers(OwnWorkers):
    """Workers in jobs of Slurm; a job that ends is followed by another."""

    def __init__(self, cluster: settings.Slurm) -> None:
        """Prepares to submit the jobs."""
        super().__init__(cluster.retries)
        self._settings = cluster

    def _start(self) -> Cluster:
        cluster = slurm_cluster(self._settings)
        cluster.adapt(minimum_jobs=self._settings.jobs, maximum_jobs=self._settings.jobs)
        return cluster


def slurm_cluster(of: settings.Slurm) -> Any:
    """Starts a scheduler in this process that can submit jobs to Slurm; none is submitted yet.

    Raises:
        MissingDependency: dask-jobqueue is not installed.
    """
    try:
        from dask_jobqueue.slurm import SLURMCluster
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
        scheduler_options=_NO_DASHBOARD,
        **{name: value for name, value in optional.items() if value is not None},
    )


def threads_of(client: Client) -> dict[str, int]:
    """Returns the number of threads of every worker by its address."""
    threads: Any = client.nthreads()
    return threads


def _require_dask() -> None:
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise MissingDependency(MISSING) from None


def _quiet(retries: int) -> Any:
    """Sets what a scheduler in this process takes over when it starts."""
    from dask import config

    return config.set(
        {
            "distributed.scheduler.allowed-failures": retries,
            # One run a worker: one that dies is counted against its own run only.
            "distributed.scheduler.worker-saturation": 1.0,
            "distributed.worker.daemon": True,
        }
    )
