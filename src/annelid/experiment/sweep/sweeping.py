"""A sweep: its runs computed by a cluster's workers as far as they are not there, and their results as one dataset."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from annelid.config import Cluster, Study, find_cluster, load_study
from annelid.experiment.cluster import workers_of
from annelid.experiment.progress import StudyProgress
from annelid.experiment.store import Store
from annelid.experiment.sweep.dataset import Sweep, dataset_of
from annelid.experiment.sweep.design import plan_of
from annelid.experiment.sweep.numbers import check_rank, chosen_numbers
from annelid.simulation.lock import locks

if TYPE_CHECKING:
    import xarray as xr

RUNS = "runs"
"""Subfolder of the runs."""


@locks("folder")
def sweep(
    study: Study | str | Path | Mapping[str, Any],
    folder: str | Path = "sweep",
    *,
    cluster: Cluster | str | None = None,
    jobs: int | None = None,
    progress: StudyProgress | None = None,
) -> xr.Dataset:
    """Computes a sweep, writes its results, and returns them.

    Call it below ``if __name__ == "__main__":``, since workers start as new processes.

    Args:
        study: The study, the path of its TOML file, or a nested mapping.
        folder: Folder for ``sweep.nc``, ``sweep.csv``, a figure, and the runs, which a second call finds there.
        cluster: Where runs are computed: a section, or a word as `find_cluster` takes; default: processes of this
            machine. What a study says of it is not used, since a scheduler and a job run code: name its file here.
        jobs: Workers, instead of as many as there are cores, or as the cluster says.
        progress: Called at the start and after every run.

    Returns:
        Every number of summary and gait with ``units`` and ``long_name``: along the varied fields of a grid, or along
        ``sample``; further along ``repeat`` and ``segment`` where there are such. ``status``, ``reason``, ``warnings``
        and ``run`` tell of each run whether it is complete, why not, what is doubtful about it, and its folder.

    Raises:
        ConfigError: The study is refused, or all of its runs are.
        MissingDependency: Dask, SciPy or dask-jobqueue is needed and not installed.
        ClusterError: The workers are lost for good; finished runs are kept.
        RunFileError: A file cannot be written.
        KeyboardInterrupt: Finished runs are kept.
    """
    from annelid.experiment.sweep.results import write_results

    to_use = f'pass cluster="{study}"' if isinstance(study, str | Path) else "pass it as cluster"
    done = swept(load_study(study), Path(folder), cluster=cluster, jobs=jobs, progress=progress, to_use=to_use)
    data = dataset_of(done)
    write_results(done, data)
    return data


def swept(
    study: Study,
    folder: Path,
    *,
    cluster: Cluster | str | None = None,
    jobs: int | None = None,
    progress: StudyProgress | None = None,
    to_use: str = "pass it as cluster",
) -> Sweep:
    """Computes a sweep as `sweep` does, in a folder that the caller has locked, and writes nothing but the runs.

    Args:
        study: The study.
        folder: As of `sweep`.
        cluster: As of `sweep`.
        jobs: As of `sweep`.
        progress: As of `sweep`.
        to_use: What the user has to do to have the cluster used that the study describes, for a sentence.
    """
    numbers = chosen_numbers(study.outputs)
    check_rank(study.rank, numbers)
    if cluster is None and study.cluster is not None:
        warnings.warn(
            f"the study {study.name!r} describes a cluster ({study.cluster}): not used; {to_use} to use it",
            stacklevel=2,
        )
    chosen = find_cluster(cluster or "processes") if cluster is None or isinstance(cluster, str) else cluster
    its_workers = workers_of(chosen, jobs)
    plan = plan_of(study)
    with its_workers as workers:
        cases = [point.case for point in plan.points]
        done = Store(folder / RUNS, workers, study.keep).finish(cases, "sweep", progress=progress)
    if all(one.refused for one in done) and done[0].error is not None:
        raise done[0].error
    return Sweep(plan, tuple(numbers), tuple(done), folder)
