"""What a run's numbers owe to its step and its mesh: the same run at half the step and with one more element a side."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from annelid.analysis import NUMBERS
from annelid.config import RunConfig
from annelid.errors import listed
from annelid.experiment.case import Case
from annelid.experiment.finer_runs import STEP, finer_steps, more_elements, run_with_variants
from annelid.experiment.outcome import Outcome
from annelid.experiment.progress import StudyProgress
from annelid.experiment.store import Done, Store
from annelid.output import write_json
from annelid.simulation.lock import locks
from annelid.simulation.runfile import Run, open_run

__all__ = ["Check", "check"]

RUNS = "check"
"""Subfolder of the runs, and the name of the file of results."""
RESOLVED = 0.1
"""Share of a number by which it may move; of a number that is a share, the change itself."""
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


@dataclass(frozen=True)
class Check:
    """How far a run's numbers move when it is computed more finely.

    Attributes:
        finer: What was made finer, in a few words, with the fields that differ, by dotted path.
        moved: By number and what was made finer, the change over the run's own value; of a number that is a share, the
            change itself. The largest over the segments; infinite where only one of the two runs has the number.
        differences: What differs otherwise (order of contractions, a finer run is stopped or fails), a clause each.
    """

    finer: Mapping[str, Mapping[str, Any]]
    moved: Mapping[str, Mapping[str, float]]
    differences: tuple[str, ...]

    def largest(self, name: str) -> float:
        """Returns how far a number moves at most; 0 where it was not compared."""
        return max(self.moved.get(name, {}).values(), default=0.0)

    @property
    def unresolved(self) -> tuple[str, ...]:
        """Numbers that move by more than `RESOLVED`."""
        return tuple(name for name in self.moved if self.largest(name) > RESOLVED)

    @property
    def resolved(self) -> bool:
        """Whether all numbers move by at most `RESOLVED`, and nothing else differs."""
        return not self.unresolved and not self.differences

    def cell(self, name: str) -> str:
        """Says how far a number moves, with ! if it is not resolved, for a table; empty where it was not compared."""
        if name not in self.moved:
            return ""
        return percent(self.largest(name)) + (" !" if self.largest(name) > RESOLVED else "")

    @property
    def faults(self) -> list[str]:
        """What differs and what moves, a clause each; empty where the run is resolved."""
        faults = [*self.differences]
        if self.unresolved:
            named = listed(f"{NUMBERS[name].label} ({percent(self.largest(name))})" for name in self.unresolved)
            faults.append(f"these numbers move by more than {percent(RESOLVED)}: {named}")
        return faults

    @property
    def sentence(self) -> str:
        """Says in plain words what the check has found."""
        finer = " and ".join(self.finer)
        left = " Only the step is finer: this body has no finer mesh." if len(self.finer) == 1 else ""
        if self.resolved:
            return f"Resolved: with {finer} no number moves by more than {percent(RESOLVED)}.{left}"
        # A finer step costs less than a finer mesh, so that it comes first where both help.
        moved = [self.moved[name] for name in self.unresolved]
        helps = [one for one in self.finer if any(by.get(one, 0.0) > RESOLVED for by in moved)]
        field, value = next(iter(self.finer[(helps or [*self.finer])[0]].items()))
        return (
            f"Not resolved: with {finer} {'; '.join(self.faults)}. Try --set {field}={value:g}, and check again.{left}"
        )

    def to_dict(self) -> dict[str, Any]:
        """Returns all of it for JSON, where a change is None if only one of the two runs has the number."""
        return {
            "resolved": self.resolved,
            "sentence": self.sentence,
            "limit": RESOLVED,
            "moved": {
                name: {finer: None if math.isinf(share) else share for finer, share in by.items()}
                for name, by in self.moved.items()
            },
            "not_resolved": list(self.unresolved),
            "finer": {finer: dict(changes) for finer, changes in self.finer.items()},
            "differences": list(self.differences),
        }


def percent(share: float) -> str:
    """Writes a share in percent with two digits, as ``3.4 %``."""
    return "lost" if math.isinf(share) else f"{100 * share:.2g} %" if share < 0.995 else f"{100 * share:.0f} %"


def refinements(config: RunConfig) -> dict[str, Mapping[str, Any]]:
    """Returns how a run is repeated more finely: what differs, by what is finer; a chain keeps the paper's elements."""
    half, elements = finer_steps(config)[0], config.body.elements
    finer: dict[str, Mapping[str, Any]] = {f"half the step ({1e3 * half[STEP]:g} ms)": half}
    if elements is not None and not config.body.is_papers:
        finer |= {f"one more element a side ({elements.number + 1})": more for more in more_elements(config)[:1]}
    return finer


def compare(run: Outcome, finer: Mapping[str, Mapping[str, Any]], runs: Mapping[str, Done]) -> Check:
    """Compares a run's numbers with those of finer ones, what became of which is given by what is finer."""
    moved: dict[str, dict[str, float]] = {}
    differences: list[str] = []
    for words, done in runs.items():
        if done.outcome is None or done.reason:
            differences.append(f"the run with {words} {'is stopped' if done.outcome else 'fails'} ({done.reason})")
            continue
        found = done.outcome
        if (found.rhythm.verdict, found.summary.wave) != (run.rhythm.verdict, run.summary.wave):
            differences.append(f"the order of contractions is another one with {words}")
        for name in CHECKED:
            before, after = getattr(run.summary, name), getattr(found.summary, name)
            change = _change(before, after, of_share=NUMBERS[name].unit == "1")
            if change is not None:
                moved.setdefault(name, {})[words] = change
    return Check(finer, moved, tuple(differences))


def _change(value: Any, other: Any, *, of_share: bool) -> float | None:
    if value is None or other is None:
        return None if value is None and other is None else math.inf
    before, after = np.atleast_1d(value).astype(float), np.atleast_1d(other).astype(float)
    # A segment that has not contracted yet has no force.
    there = ~np.isnan(before)
    if (there == np.isnan(after)).any():
        return math.inf
    if not there.any():
        return None
    before, after = before[there], after[there]
    scale = np.ones(len(before)) if of_share else np.abs(before)
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
    progress: StudyProgress | None = None,
) -> tuple[Run, Check]:
    """Runs a worm, and beside it the same worm at half the step and with one more element a side.

    Args:
        config: Any worm; of one without a finer mesh only the step is made finer.
        folder: Folder of the run, ``run.nc``; all runs are kept in ``check`` below it, and a second call goes on.
        executor: Who computes the runs; None for processes of this machine.
        jobs: How many processes, by default one a core.
        overwrite: Allow a folder that has something else in it, and replace its ``run.nc``.
        progress: Called as the runs are done.

    Returns:
        The run, and what its numbers owe to step and mesh.

    Raises:
        ConfigError: The folder is in use.
        RunFileError: A file cannot be written.
        SimulationStopped: A guard stopped the run itself; its file is kept.
        KeyboardInterrupt: Finished runs are kept, the run itself also as ``run.nc``.
    """
    folder, finer = Path(folder), refinements(config)
    how: dict[str, Any] = {"executor": executor, "jobs": jobs, "overwrite": overwrite, "progress": progress}
    itself, *done = run_with_variants(config, folder, RUNS, [*finer.values()], **how)
    assert itself.outcome is not None
    found = compare(itself.outcome, finer, dict(zip(finer, done, strict=True)))
    write_json(folder / f"{RUNS}.json", found.to_dict())
    return open_run(folder), found


def check_runs(store: Store, of: Sequence[Case]) -> list[Check]:
    """Checks runs that a store has, by finer runs that it computes and keeps.

    Args:
        store: The store.
        of: The cases of the runs.

    Returns:
        What the numbers of each run owe to step and mesh.

    Raises:
        KeyboardInterrupt: Finished runs are kept.
    """
    plans = [(case, refinements(case.config)) for case in of]
    cases = [Case(case.preset, changes, case.config) for case, finer in plans for changes in finer.values()]
    done = iter(store.finish(cases, "finer runs"))
    return [compare(store[case], finer, {words: next(done) for words in finer}) for case, finer in plans]
