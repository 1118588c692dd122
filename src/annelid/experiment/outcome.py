"""What a study keeps of a run: its numbers, the score of its rhythm, and readings at the end of each contraction."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from annelid.analysis import RhythmScore, Summary, rhythm_score, summary
from annelid.experiment.fingerprint import READERS, code_fingerprint
from annelid.simulation.runfile import Run

OUTCOME_NAME = "outcome.json"


@dataclass(frozen=True, slots=True)
class Hold:
    """Readings at the end of one open-loop contraction, the worm about at rest."""

    segment: int
    """The contracted segment, from 1."""
    elongation_mean_m: tuple[float, ...]
    """Mean elongation of every segment's springs, the contracted one's among them."""
    elongation_first_helix_m: tuple[float, ...]
    """The same of the spring on the first helix."""
    ring_length_m: float
    """Length of the contracted segment's ring."""
    pin_gap_m: float | None
    """Largest gap between two pinned strands; None where pins cannot part."""
    force_N: float | None
    """Force of the contracted segment's muscle; None for a worm without forces."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a study keeps of a run, which lies in the folder ``path``."""

    path: Path
    summary: Summary
    rhythm: RhythmScore
    holds: tuple[Hold, ...]
    """Of its open-loop contractions, in the order of the program; empty in closed loop."""
    message: str
    """Why it ended before its time; empty if it did not."""
    cpu_time_s: float = 0.0
    """Processor time that the run took, whatever else the machine did; 0 where it is not known."""


class _Written(BaseModel):
    """An outcome as it stands in its file, with the mark of the code that read it."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)

    reader: str
    summary: Summary
    rhythm: RhythmScore
    holds: tuple[Hold, ...]
    message: str
    cpu_time_s: float


def outcome(run: Run) -> Outcome:
    """Reads a run's outcome."""
    return Outcome(run.path.parent, summary(run), rhythm_score(run), _holds(run), run.message, run.cpu_time_s)


def write_outcome(read: Outcome, path: Path) -> None:
    """Writes an outcome as JSON, with the mark of this code, which read it."""
    content = {"reader": code_fingerprint(*READERS), **asdict(read)}
    del content["path"]
    path.write_text(json.dumps(content, allow_nan=False), encoding="utf-8")


def read_outcome(path: Path) -> Outcome:
    """Reads an outcome; a ValueError where its file is damaged, or other code than this read the run."""
    try:
        content = _Written.model_validate_json(path.read_bytes())
    except ValidationError as error:
        wrong = error.errors(include_url=False, include_context=False, include_input=False)[0]
        raise ValueError(f"{path} is no outcome: {'.'.join(map(str, wrong['loc']))}: {wrong['msg']}") from None
    if content.reader != code_fingerprint(*READERS):
        raise ValueError(f"{path} was read by other code")
    return Outcome(path.parent, **{name: value for name, value in content if name != "reader"})


def _holds(run: Run) -> tuple[Hold, ...]:
    contractions, data = run.config.controller.scheduled, run.variables
    if not contractions or not data["time"].values.size:
        return ()
    times = data["time"].values
    shape = len(times), run.config.body.n_segments, -1
    above_rest = data["stretch_length"].values - data["stretch_rest_length"].values
    ring = data["ring_length"].values.reshape(shape).sum(axis=2)
    force = data["muscle_force"].values.reshape(shape).mean(axis=2) if "muscle_force" in data else None
    holds = []
    for contraction in contractions:
        if times[-1] < contraction.stop_s - 2 * float(np.diff(times).max(initial=0.0)):
            continue
        last, segment = np.flatnonzero(times <= contraction.stop_s + 1e-9)[-1], contraction.segment - 1
        holds.append(
            Hold(
                contraction.segment,
                tuple(above_rest[last].mean(axis=1).tolist()),
                tuple(above_rest[last, :, 0].tolist()),
                float(ring[last, segment]),
                float(data["pin_gap"].values[last]) if "pin_gap" in data else None,
                # The activation ends with the step that leads to the last sample; the force is of the one before.
                None if force is None else float(force[max(last - 1, 0), segment]),
            )
        )
    return tuple(holds)
