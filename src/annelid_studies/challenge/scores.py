"""Scores of a run, from its file alone: speed towards the goal, what it costs, order, and refusals."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import nan
from pathlib import Path

import numpy as np
from pydantic import FiniteFloat, TypeAdapter, ValidationError

from annelid.analysis import lengthening_score, passage_of
from annelid.errors import RunFileError
from annelid.experiment import Store, case_key, numerical_problem
from annelid.simulation import Run
from annelid_studies.challenge.tasks import Entry, Task, all_tasks

STALL_FORCE_N, FREE_SPEED_M_PER_S = 13.0, 0.064
"""Cable force at which the robot's servos stall, and cable speed without load (docs/evidence/presets.md)."""
NUMERICAL_SHARE = 0.05
"""Share of the muscles' work that the integrator may take or add; beyond that, half the step is tried.

Where it is less, speed at the bodies' steps is within some 5 % of that at finer ones (docs/evidence/challenge.md).
"""
INTEGRATOR = "the integrator"
"""What `numerical_problem` begins with."""
_EMPTY: dict[str, str] = dict.fromkeys(("slip_J", "work_J", "electric_J", "length_m"), "nan")
"""What an empty cell of these columns of ``runs.csv`` stands for."""


@dataclass(frozen=True, slots=True)
class Score:
    """What one run scored; an entrant that was refused has no numbers."""

    entrant: str
    body: str
    task: str
    version: int  # Of the tasks
    seed: int  # Of the draw
    finer: int  # How many times as short as the tasks' the steps are
    drawn: str  # What was drawn
    setup: str  # Digest of what the task and the entrant set
    key: str  # Digest of the run's configuration, of the code that computes it, and of the engine
    refused: str  # Why it does not count; empty if it does
    speed_m_per_s: FiniteFloat  # Mean speed towards the goal after settling; 0 where refused
    distance_m: FiniteFloat  # That way; 0 where refused
    slip_J: float  # Work lost to friction in that time
    work_J: float  # Positive work of the muscles in that time
    electric_J: float  # Energy that the motors of `electric_energy_J` take in that time
    in_order: bool  # Whether segments lengthen in one wave from front to rear, to the end
    length_m: float  # Of the body at rest
    halved: bool = False  # Whether it was run at half that step, since the integrator took too much


def challenge(store: Store, wanted: Sequence[Entry], known: Sequence[Score] = ()) -> list[Score]:
    """Runs entries, as far as neither the store nor earlier scores have them, and scores them in their order.

    A run of which the integrator takes too much is taken at half the step instead.
    """
    scores = {(one.entrant, one.setup): one for one in known}
    keys = [(entry.entrant, entry.setup) for entry in wanted]
    new = {key: entry for key, entry in zip(keys, wanted, strict=True) if key not in scores}
    scores |= dict(zip(new, _scored(store, list(new.values())), strict=True))
    doubtful = {
        key: entry
        for key, entry in zip(keys, wanted, strict=True)
        if scores[key].refused.startswith(INTEGRATOR) and not scores[key].halved
    }
    again = _scored(store, [entry.halved() for entry in doubtful.values()])
    for (key, entry), one in zip(doubtful.items(), again, strict=True):
        scores[key] = replace(one, finer=entry.finer, setup=entry.setup, halved=True)
    return [scores[key] for key in keys]


def _scored(store: Store, entries: Sequence[Entry]) -> list[Score]:
    """Runs entries and scores them."""
    done = store.finish([entry.case for entry in entries], "challenge") if entries else []
    found = []
    for entry, one in zip(entries, done, strict=True):
        numerics = "" if one.outcome is None else numerical_problem(one.outcome, NUMERICAL_SHARE)
        found.append(_score(entry, one.reason or numerics, store))
    return found


def read_scores(path: Path) -> list[Score]:
    """Reads the scores that an earlier call wrote as CSV.

    Raises:
        RunFileError: It is not such a file, or it is of another version of the tasks.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = [
                {name: cell or _EMPTY.get(name, cell) for name, cell in row.items()} for row in csv.DictReader(file)
            ]
        scores = TypeAdapter(list[Score]).validate_python(rows)
    except ValidationError as error:
        first = error.errors()[0]
        where = f"row {first['loc'][0]}, {first['loc'][-1]}"
        raise RunFileError(f"{path} is no runs.csv of annelid study challenge: {where}: {first['msg']}") from None
    except (OSError, ValueError, csv.Error) as error:
        raise RunFileError(f"{path} is no runs.csv of annelid study challenge: {error}") from None
    versions = {one.version for one in scores} - {all_tasks().version}
    if versions:
        raise RunFileError(f"{path} is of version {min(versions)} of the tasks; here it is {all_tasks().version}")
    return scores


def _score(entry: Entry, refused: str, store: Store) -> Score:
    found, key = all_tasks(), case_key(entry.case) if entry.case in store else ""
    settling_s = found.settling_s
    named = entry.entrant, entry.body, entry.task, found.version, entry.seed, entry.finer, entry.drawn, entry.setup
    if refused:
        return Score(*named, key, refused, 0.0, 0.0, nan, nan, nan, False, nan)
    run = store.run(entry.case)
    time, way = progress(run, found.tasks[entry.task])
    first = int(np.searchsorted(time, settling_s - 1e-9))
    distance = float(way[-1] - way[first])
    judged = run.data.isel(time=run.data["time"].values >= settling_s - 1e-9)
    slip = work = electric = nan
    if "slip_loss" in judged and "positive_work" in judged:  # Robots of MJCF have none.
        slip, work = (float((judged[name][-1] - judged[name][0]).sum()) for name in ("slip_loss", "positive_work"))
        electric = electric_energy_J(judged["time"].values, judged["muscle_force"].values, judged["ring_length"].values)
    speed = distance / float(time[-1] - time[first])
    speed, distance, slip, work, electric = (float(f"{one:.6g}") for one in (speed, distance, slip, work, electric))
    in_order = lengthening_score(run, settling_s).is_one_wave
    length_m = float(run.data.attrs.get("body_length_m", nan))
    return Score(*named, key, "", speed, distance, slip, work, electric, in_order, length_m)


def progress(run: Run, task: Task) -> tuple[np.ndarray, np.ndarray]:
    """Returns times, s, and how far the worm is towards the goal then, m, ``(n,)`` each.

    In a pipe it is the mean arc length of the rings along the centre line, at the times of the postures; else the
    centre of mass along the initial heading.
    """
    if task.goal == "pipe":
        passage = passage_of(run)
        return passage.time_s, passage.middle_m
    return run.data["time"].values, -run.data["center_of_mass"].sel(axis="x").values


def electric_energy_J(time_s: np.ndarray, force_N: np.ndarray, length_m: np.ndarray) -> float:
    """Energy that direct-current motors would take to pull as the muscles did.

    Their power is ``max(0, F v + F^2 v0 / F0)``, mechanical power and the heat of the current, with the force F0 at
    which a motor stands still and its speed v0 without load.

    Args:
        time_s: Times of the samples, s, ``(n,)``.
        force_N: Force of every muscle, N, ``(n, n_muscles)``; a sample's acted during the step before it.
        length_m: Length of every ring or half-ring, m, likewise.
    """
    step = np.diff(time_s)[:, np.newaxis]
    force, shortening = force_N[1:], -np.diff(length_m, axis=0) / step
    power_W = force * shortening + force**2 * FREE_SPEED_M_PER_S / STALL_FORCE_N
    return float((power_W.clip(0.0) * step).sum())
