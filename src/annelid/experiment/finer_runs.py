"""A run and variants of it: finer steps, more elements, other parameters; all kept below the folder of the run."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from annelid.config import RunConfig
from annelid.errors import ConfigError, SimulationStopped
from annelid.experiment.case import Case
from annelid.experiment.executors import workers
from annelid.experiment.progress import StudyProgress
from annelid.experiment.store import Done, Store
from annelid.output import whole_file
from annelid.simulation.runfile import FILE_NAME, read_config, refuse_used_folder

STEP = "clock.physics_timestep_s"


def finer_steps(config: RunConfig) -> list[dict[str, float]]:
    """Returns the changes to about half of a physics step and, if that is a multiple of the control step, a quarter.

    What is longer than the control step stays a whole multiple of it, so that half of 5 ms is 2 ms where that is 1 ms.
    Signals are recorded as much more often, since onsets and maxima are read from the record.
    """
    control_s, step_s = config.clock.control_timestep_s, config.clock.physics_timestep_s
    ratio = round(step_s / control_s)

    def part(duration_s: float, divisor: int) -> float:
        """The greatest multiple of the control step that is no longer than a part of a duration, s."""
        return round(max(round(duration_s / control_s) // divisor, 1) * control_s, 12)

    def finer(divisor: int) -> dict[str, float]:
        step = step_s / divisor if ratio <= 1 else part(step_s, divisor)
        return {STEP: step, "record.signals_interval_s": part(config.record.signals_interval_s, divisor)}

    return [finer(2), *([finer(4)] if ratio > 1 and ratio % 4 == 0 else [])]


def more_elements(config: RunConfig) -> list[dict[str, int]]:
    """Returns what gives a body one and two elements more than it has, as far as that is allowed."""
    elements = config.body.elements
    if elements is None:
        return []
    counts = range(elements.number + 1, min(elements.number + 2, elements.most) + 1)
    return [{elements.field: count} for count in counts]


def run_with_variants(
    config: RunConfig,
    folder: Path,
    runs: str,
    variants: Sequence[Mapping[str, Any]],
    *,
    executor: Executor | None = None,
    jobs: int | None = None,
    overwrite: bool = False,
    progress: StudyProgress | None = None,
) -> list[Done]:
    """Runs a worm and variants of it, as far as its folder, which the caller has locked, does not have them.

    Args:
        config: Of the worm.
        folder: Folder of its run, ``run.nc``.
        runs: Name of the subfolder that keeps all runs.
        variants: Fields that differ in each variant, by dotted path.
        executor: Who computes the runs; None for processes of this machine.
        jobs: How many processes, by default one a core.
        overwrite: Allow a folder that has something else in it, and replace its ``run.nc``.
        progress: Called at the start and after every run.

    Returns:
        What became of the worm itself, first, and of each variant.

    Raises:
        ConfigError: The folder is in use, or the worm means nothing.
        RunFileError: A file cannot be written.
        SimulationStopped: A guard stopped the run itself; its file is kept.
        KeyboardInterrupt: Runs in progress are dropped, all others kept for a later call, the worm's own also as
            ``run.nc``.
    """
    if overwrite or not (folder / runs).is_dir():
        refuse_used_folder(folder, overwrite)
    elif (folder / FILE_NAME).exists() and read_config(folder) != config:
        raise ConfigError(
            f"the output folder {folder} has another run in it: name another, or use --force (overwrite=True)"
        )
    cases = [Case(config.name, changed, config) for changed in ({}, *variants)]
    with workers(executor, jobs) as given:
        store = Store(folder / runs, given, progress=progress)
        try:
            done = store.finish(cases, runs)
        finally:
            # Also where the variants are interrupted.
            if cases[0] in store:
                with whole_file(folder / FILE_NAME) as draft:
                    shutil.copyfile(store.path(cases[0]) / FILE_NAME, draft)
    itself = done[0].outcome
    if itself is None:
        raise done[0].error or ConfigError(done[0].reason)
    if itself.message:
        raise SimulationStopped(itself.message)
    return done
