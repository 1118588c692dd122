"""What a run's numbers owe to its step and its mesh: the same run at half the step and with one more element a side."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from annelid.analysis import NUMBERS
from annelid.config import RunConfig
from annelid.errors import ConfigError, listed
from annelid.experiment.case import Case
from annelid.experiment.executors import workers
from annelid.experiment.outcome import Outcome, outcome
from annelid.experiment.progress import StudyProgress
from annelid.experiment.store import Store, case_key
from annelid.output import write_json
from annelid.simulation.lock import locks
from annelid.simulation.loop import simulate
from annelid.simulation.progress import ProgressCallback
from annelid.simulation.runfile import FILE_NAME, Run, open_run, read_config, refuse_used_folder

__all__ = ["Check", "Refinement", "check", "compare", "refinements"]

RUNS = "check"
"""Subfolder of the finer runs, and the name of the file of results."""
RESOLVED = 0.1
"""Share of a number by which it may move; of a number that is a share, the change itself."""
STEP = "clock.physics_timestep_s"
HALF, MORE = "half_step", "more_elements"
"""The two refinements."""
CHECKED = (
    "period_s",
    "elongation_first_helix_pp_m",
    "elongation_least_pp_m",
    "elongation_most_pp_m",
    "elongation_mean_max_m",
    "middle_deficit",
    "middle_deficit_mean",
    "end_difference",
    "contraction_force_median_N",
    "segment_force_median_N",
    "positive_work_J",
    "muscle_work_J",
    "travel_m",
    "travel_path_m",
    "ring_length_min_m",
    "pin_gap_max_m",
    "speed_m_per_s",
    "stride_m",
    "slip_ratio",
    "backward_ratio",
    "cost_of_transport",
    "cost_of_transport_net",
)
"""The numbers that are compared, of `NUMBERS`."""


@dataclass(frozen=True, eq=False)
class Refinement:
    """How a run is repeated more finely.

    Attributes:
        name: `HALF` or `MORE`.
        words: What is finer, in a few words.
        changes: Fields that differ, by dotted path.
    """

    name: str
    words: str
    changes: Mapping[str, Any]


@dataclass(frozen=True)
class Check:
    """How far a run's numbers move when it is computed more finely.

    Attributes:
        moved: By number and refinement, the change over the run's own value; of a number that is a share, the change
            itself. The largest over the segments; infinite where only one of the two runs has the number.
        refinements: What was made finer.
        left_out: What was not, and why, a sentence each.
        differences: What differs otherwise (order of contractions, a finer run is stopped or fails), a clause each.
    """

    moved: Mapping[str, Mapping[str, float]]
    refinements: tuple[Refinement, ...]
    left_out: tuple[str, ...]
    differences: tuple[str, ...]

    def largest(self, name: str) -> float | None:
        """Returns how far a number moves at most; None where the run does not have it."""
        return max(self.moved[name].values(), default=None) if name in self.moved else None

    @property
    def unresolved(self) -> tuple[str, ...]:
        """Numbers that move by more than `RESOLVED`."""
        return tuple(name for name in self.moved if (self.largest(name) or 0.0) > RESOLVED)

    @property
    def resolved(self) -> bool:
        """Whether all numbers move by at most `RESOLVED`, and nothing else differs."""
        return not self.unresolved and not self.differences

    def cell(self, name: str) -> str:
        """Says how far a number moves, for a table; empty where it was not compared."""
        largest = self.largest(name)
        if largest is None:
            return ""
        return percent(largest) + ("\nnot resolved" if largest > RESOLVED else "")

    @property
    def sentence(self) -> str:
        """Says in plain words what the check has found."""
        tried = " and ".join(one.words for one in self.refinements)
        further = "".join(f" {one}" for one in self.left_out)
        if self.resolved:
            worst = max(self.moved, key=lambda name: self.largest(name) or 0.0, default=None)
            most = f"; {NUMBERS[worst].label} moves most, by {percent(self.largest(worst) or 0.0)}" if worst else ""
            return f"Resolved: with {tried} no number moves by more than {percent(RESOLVED)}{most}.{further}"
        faults = [*self.differences]
        if self.unresolved:
            named = listed(
                [f"{NUMBERS[name].label} ({percent(self.largest(name) or 0.0)})" for name in self.unresolved]
            )
            faults.append(f"these numbers move by more than {percent(RESOLVED)}: {named}")
        return f"Not resolved: with {tried} {'; '.join(faults)}. {self._advice}{further}"

    @property
    def _advice(self) -> str:
        halves = [one for one in self.refinements if one.name == HALF]
        faults = self.unresolved
        by_step = not faults or any(self.moved[name].get(HALF, 0.0) > RESOLVED for name in faults)
        finer = halves[0] if by_step and halves else self.refinements[-1]
        path = STEP if finer.name == HALF else next(iter(finer.changes))
        return f"Try --set {path}={finer.changes[path]:g}, and check again."

    def to_dict(self) -> dict[str, Any]:
        """Returns all of it for JSON, where a change is None if only one of the two runs has the number."""
        return {
            "resolved": self.resolved,
            "sentence": self.sentence,
            "limit": RESOLVED,
            "moved": {
                name: {of: None if math.isinf(share) else share for of, share in by.items()}
                for name, by in self.moved.items()
            },
            "not_resolved": list(self.unresolved),
            "refinements": [asdict(one) for one in self.refinements],
            "left_out": list(self.left_out),
            "differences": list(self.differences),
        }


def percent(share: float) -> str:
    """Writes a share in percent with two digits, as ``3.4 %``."""
    return "lost" if math.isinf(share) else f"{100 * share:.2g} %" if share < 0.995 else f"{100 * share:.0f} %"


def refinements(config: RunConfig) -> tuple[tuple[Refinement, ...], tuple[str, ...]]:
    """Returns how a run is repeated more finely, and what is left as it is, a sentence each.

    Args:
        config: The run's configuration.

    Raises:
        ConfigError: Half of the physics step is no multiple of the control step.
    """
    control_s, step_s = config.clock.control_timestep_s, config.clock.physics_timestep_s
    ratio = round(step_s / control_s)
    if ratio > 1 and ratio % 2:
        near = " or ".join(f"{(ratio + change) * control_s:g}" for change in (-1, 1) if ratio + change)
        raise ConfigError(
            f"{STEP} = {step_s:g}: half of it is no multiple of clock.control_timestep_s = {control_s:g}, so it cannot "
            f"be checked: set it to {near}"
        )
    half = finer_steps(config)[0]
    found = [Refinement(HALF, f"half the step ({1e3 * half[STEP]:g} ms)", half)]
    elements = config.body.elements
    if elements is None:
        return tuple(found), (f"A body of kind {config.body.kind!r} has no elements: only its step is halved.",)
    if config.body.is_papers:
        return tuple(found), ("A chain keeps the paper's elements: only its step is halved.",)
    if more := more_elements(config):
        found.append(Refinement(MORE, f"one more element a side ({elements.number + 1})", more[0]))
        return tuple(found), ()
    return tuple(found), (f"The mesh has {elements.most} elements a side, the most that are allowed.",)


def compare(run: Outcome, finer: Mapping[Refinement, Outcome | str], left_out: Sequence[str] = ()) -> Check:
    """Compares a run's numbers with those of finer ones.

    Args:
        run: The run.
        finer: What came of each refinement, or why it failed.
        left_out: What was not refined, and why, a sentence each.
    """
    moved: dict[str, dict[str, float]] = {}
    differences: list[str] = []
    for one, found in finer.items():
        if isinstance(found, str):
            differences.append(f"the run with {one.words} fails ({found})")
            continue
        if found.message:
            differences.append(f"the run with {one.words} is stopped ({found.message})")
            continue
        if (found.rhythm.verdict, found.summary.wave) != (run.rhythm.verdict, run.summary.wave):
            differences.append(f"the order of contractions is another one with {one.words}")
        for name in CHECKED:
            values = getattr(run.summary, name), getattr(found.summary, name)
            change = _change(*values, of_share=NUMBERS[name].unit == "1")
            if change is not None:
                moved.setdefault(name, {})[one.name] = change
    return Check(moved, tuple(finer), tuple(left_out), tuple(differences))


def _change(value: Any, other: Any, *, of_share: bool) -> float | None:
    if value is None or other is None:
        return None if value is None and other is None else math.inf
    before, after = np.atleast_1d(value).astype(float), np.atleast_1d(other).astype(float)
    if of_share:
        return float(np.abs(after - before).max())
    scale = np.abs(before)
    if not scale.all():
        return 0.0 if (before == after).all() else math.inf
    return float((np.abs(after - before) / scale).max())


@locks("folder")
def check(
    config: RunConfig,
    folder: str | Path,
    *,
    executor: Executor | None = None,
    jobs: int | None = None,
    overwrite: bool = False,
    run_progress: bool | ProgressCallback | None = False,
    progress: StudyProgress | None = None,
) -> tuple[Run, Check]:
    """Runs a worm, and beside it the same worm at half the step and with one more element a side.

    Args:
        config: Any worm; what a planar one or a chain has no finer form of is left out, and the check says so.
        folder: Folder of the run, ``run.nc``; the finer runs are kept in ``check`` below it, and a second call goes on.
        executor: Who computes the finer runs; None for processes of this machine.
        jobs: How many processes, by default one a core.
        overwrite: Allow a folder that has something else in it, and replace its ``run.nc``.
        run_progress: Of the run itself, as `annelid.simulate` takes it.
        progress: Called as the finer runs are done.

    Returns:
        The run, and what its numbers owe to step and mesh.

    Raises:
        ConfigError: Half of the step does not fit the control step, or the folder is in use.
        RunFileError: A file cannot be written.
        SimulationStopped: A guard stopped the run itself; its file is kept.
        KeyboardInterrupt: The run itself is kept as far as it is, as are finer ones that are done.
    """
    folder = Path(folder)
    finer, left_out = refinements(config)
    go_on_in(folder, RUNS, config, overwrite=overwrite)
    cases = [Case(config.name, dict(one.changes), config) for one in finer]
    done: list[Run] = []

    def run_itself() -> None:
        if (folder / FILE_NAME).exists() and read_config(folder) == config and open_run(folder).status == "complete":
            done.append(open_run(folder))
            return
        run = simulate(config, folder, progress=run_progress, overwrite=True)
        if run.status == "interrupted":
            raise KeyboardInterrupt
        done.append(run)

    def report(stage: str, n_done: int, total: int, share: float) -> None:
        if done and progress is not None:
            progress(stage, n_done, total, share)

    with workers(executor, jobs) as given:
        outcomes = Store(folder / RUNS, given).compute(cases, "check", progress=report, meanwhile=run_itself)
    found = compare(
        outcome(done[0]),
        {one: outcomes[case_key(case)] for one, case in zip(finer, cases, strict=True)},
        left_out,
    )
    write_json(folder / f"{RUNS}.json", found.to_dict())
    return done[0], found


def check_runs(store: Store, cases: Sequence[Case]) -> list[Check]:
    """Checks runs that a store has, by finer ones that it computes and keeps.

    Raises:
        ConfigError: Half of a step is no multiple of the control step.
        KeyboardInterrupt: Finished runs are kept.
    """
    plans = [(case, *refinements(case.config)) for case in cases]
    finer = [Case(case.preset, dict(one.changes), case.config) for case, found, _ in plans for one in found]
    came = iter([done.outcome or done.reason for done in store.finish(finer, "finer runs")])
    return [compare(store[case], {one: next(came) for one in found}, left_out) for case, found, left_out in plans]


def go_on_in(folder: Path, runs: str, config: RunConfig, *, overwrite: bool) -> None:
    """Refuses a folder that a study of one run, which keeps its further runs in a subfolder, must not write into.

    A study goes on in its own folder, and into an empty one.
    """
    if overwrite or not (folder / runs).is_dir():
        refuse_used_folder(folder, overwrite)
    elif (folder / FILE_NAME).exists() and read_config(folder) != config:
        raise ConfigError(f"the output folder {folder} has another run in it: name another, or allow overwriting")


def finer_steps(config: RunConfig) -> list[dict[str, float]]:
    """Returns the changes to about half of a physics step and, if that is a multiple of the control step, a quarter.

    What is longer than the control step stays a whole multiple of it, so that half of 5 ms is 2 ms where that is 1 ms.
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
