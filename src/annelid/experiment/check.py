"""What a run's numbers owe to its step and its mesh: the same run at half the step and with one more element a side."""

from __future__ import annotations

import math
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from annelid.analysis import NUMBERS
from annelid.config import RunConfig
from annelid.errors import ConfigError, listed
from annelid.experiment.finer_runs import STEP, finer_steps, more_elements, run_with_variants
from annelid.experiment.outcome import Outcome
from annelid.experiment.progress import StudyProgress
from annelid.experiment.store import Done
from annelid.output import write_json
from annelid.simulation.lock import locks
from annelid.simulation.runfile import Run, open_run

__all__ = ["Check", "Refinement", "check", "compare", "refinements"]

RUNS = "check"
"""Subfolder of the runs, and the name of the file of results."""
RESOLVED = 0.1
"""Share of a number by which it may move; of a number that is a share, the change itself."""
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
        field: The one that is finer.
    """

    name: str
    words: str
    changes: Mapping[str, Any]
    field: str


@dataclass(frozen=True)
class Check:
    """How far a run's numbers move when it is computed more finely.

    Attributes:
        moved: By number and refinement, the change over the run's own value; of a number that is a share, the change
            itself. The largest over the segments; infinite where only one of the two runs has the number.
        refinements: What was made finer.
        left_out: What was not, and why, in a sentence; empty if nothing was.
        differences: What differs otherwise (order of contractions, a finer run is stopped or fails), a clause each.
    """

    moved: Mapping[str, Mapping[str, float]]
    refinements: tuple[Refinement, ...]
    left_out: str
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

    @property
    def worst(self) -> str | None:
        """The number that moves most; None where none was compared."""
        return max(self.moved, key=self.largest, default=None)

    def cell(self, name: str) -> str:
        """Says how far a number moves, for a table; empty where it was not compared."""
        if name not in self.moved:
            return ""
        return percent(self.largest(name)) + ("\nnot resolved" if self.largest(name) > RESOLVED else "")

    def _named(self, name: str) -> str:
        return f"{NUMBERS[name].label} ({percent(self.largest(name))})"

    @property
    def sentence(self) -> str:
        """Says in plain words what the check has found."""
        finer = " and ".join(one.words for one in self.refinements)
        further = f" {self.left_out}" if self.left_out else ""
        if self.resolved:
            most = "" if self.worst is None else f"; most of all moves {self._named(self.worst)}"
            return f"Resolved: with {finer} no number moves by more than {percent(RESOLVED)}{most}.{further}"
        faults = [*self.differences]
        if self.unresolved:
            named = listed(map(self._named, self.unresolved))
            faults.append(f"these numbers move by more than {percent(RESOLVED)}: {named}")
        # A finer step costs less than a finer mesh, so that it comes first where both help.
        by_step = not self.unresolved or any(self.moved[name].get(HALF, 0.0) > RESOLVED for name in self.unresolved)
        try_this = self.refinements[0 if by_step else -1]
        advice = f"Try --set {try_this.field}={try_this.changes[try_this.field]:g}, and check again."
        return f"Not resolved: with {finer} {'; '.join(faults)}. {advice}{further}"

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
            "left_out": self.left_out,
            "differences": list(self.differences),
        }


def percent(share: float) -> str:
    """Writes a share in percent with two digits, as ``3.4 %``."""
    return "lost" if math.isinf(share) else f"{100 * share:.2g} %" if share < 0.995 else f"{100 * share:.0f} %"


def refinements(config: RunConfig) -> tuple[tuple[Refinement, ...], str]:
    """Returns how a run is repeated more finely, and what is left as it is, in a sentence.

    Args:
        config: The run's configuration.

    Raises:
        ConfigError: Half of the physics step is no multiple of the control step.
    """
    control_s, step_s = config.clock.control_timestep_s, config.clock.physics_timestep_s
    ratio = round(step_s / control_s)
    if ratio > 1 and ratio % 2:
        raise ConfigError(
            f"{STEP} = {step_s:g}: half of it is no multiple of clock.control_timestep_s = {control_s:g}, so it cannot "
            f"be checked: set it to {(ratio - 1) * control_s:g} or {(ratio + 1) * control_s:g}"
        )
    half = finer_steps(config)[0]
    by_step = Refinement(HALF, f"half the step ({1e3 * half[STEP]:g} ms)", half, STEP)
    elements, more = config.body.elements, more_elements(config)
    if elements is None:
        return (by_step,), f"A body of kind {config.body.kind!r} has no elements: only its step is halved."
    if config.body.is_papers:
        return (by_step,), "A chain keeps the paper's elements: only its step is halved."
    if not more:
        return (by_step,), f"The mesh has {elements.most} elements a side, the most that are allowed."
    words = f"one more element a side ({elements.number + 1})"
    return (by_step, Refinement(MORE, words, more[0], elements.field)), ""


def compare(run: Outcome, finer: Mapping[Refinement, Done], left_out: str = "") -> Check:
    """Compares a run's numbers with those of finer ones.

    Args:
        run: The run.
        finer: What became of each finer run.
        left_out: What was not refined, and why, in a sentence.
    """
    moved: dict[str, dict[str, float]] = {}
    differences: list[str] = []
    for one, done in finer.items():
        if done.outcome is None or done.outcome.message:
            ended = "fails" if done.outcome is None else "is stopped"
            differences.append(f"the run with {one.words} {ended} ({done.reason})")
            continue
        found = done.outcome
        if (found.rhythm.verdict, found.summary.wave) != (run.rhythm.verdict, run.summary.wave):
            differences.append(f"the order of contractions is another one with {one.words}")
        for name in CHECKED:
            before, after = getattr(run.summary, name), getattr(found.summary, name)
            change = _change(before, after, of_share=NUMBERS[name].unit == "1")
            if change is not None:
                moved.setdefault(name, {})[one.name] = change
    return Check(moved, tuple(finer), left_out, tuple(differences))


def _change(value: Any, other: Any, *, of_share: bool) -> float | None:
    if value is None or other is None:
        return None if value is None and other is None else math.inf
    before, after = np.atleast_1d(value).astype(float), np.atleast_1d(other).astype(float)
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
        config: Any worm; what a planar one or a chain has no finer form of is left out, and the check says so.
        folder: Folder of the run, ``run.nc``; all runs are kept in ``check`` below it, and a second call goes on.
        executor: Who computes the runs; None for processes of this machine.
        jobs: How many processes, by default one a core.
        overwrite: Allow a folder that has something else in it, and replace its ``run.nc``.
        progress: Called as the runs are done.

    Returns:
        The run, and what its numbers owe to step and mesh.

    Raises:
        ConfigError: Half of the step does not fit the control step, or the folder is in use.
        RunFileError: A file cannot be written.
        SimulationStopped: A guard stopped the run itself; its file is kept.
        KeyboardInterrupt: Finished runs are kept, the run itself also as ``run.nc``.
    """
    folder = Path(folder)
    finer, left_out = refinements(config)
    itself, *done = run_with_variants(
        config,
        folder,
        RUNS,
        [one.changes for one in finer],
        executor=executor,
        jobs=jobs,
        overwrite=overwrite,
        progress=progress,
    )
    assert itself.outcome is not None
    found = compare(itself.outcome, dict(zip(finer, done, strict=True)), left_out)
    write_json(folder / f"{RUNS}.json", found.to_dict())
    return open_run(folder), found
