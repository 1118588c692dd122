"""What each part of pressure feedback saves of slip, and at half the physics step.

    python benchmarks/slip_parts.py --csv docs/results/slip_parts.csv

Runs are kept in ``slip/runs``, where `annelid experiment slip` has its own, of the tuning frictions only.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from annelid.analysis.gait import slip_cost
from annelid.experiment.case import Case
from annelid.experiment.store import Store
from annelid.output import write_csv
from annelid_studies.slip import EXTENSION, PLAIN, PRESET, PRESSURE, TUNED_AT, case, percent

HALF_STEP = {"clock.physics_timestep_s": 0.005, "duration_s": 10.0}


def without(friction: float, *synapses: str) -> Case:
    """The run with feedback, some of its synapses left out."""
    changes: dict[str, Any] = dict(case(PRESSURE, friction).changes)
    changes["controller"] = changes["controller"] | dict.fromkeys(synapses, 0.0)
    return Case(PRESET, changes)


def half_step(feedback: str, friction: float) -> Case:
    """The run of one kind of feedback at half the physics step, shorter than the others."""
    return Case(PRESET, {**case(feedback, friction).changes, **HALF_STEP})


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--csv", type=Path, help="file for the numbers")
    path, rows = parser.parse_args().csv, []
    pairs: list[tuple[str, float, Case, Case]] = []
    for friction in TUNED_AT:
        plain = case(PLAIN, friction)
        pairs += [
            ("all", friction, plain, case(PRESSURE, friction)),
            ("no hold", friction, plain, case(EXTENSION, friction)),
            ("no exchange", friction, plain, without(friction, "exchange")),
        ]
    low = TUNED_AT[0]
    pairs.append(("all, half the step", low, half_step(PLAIN, low), half_step(PRESSURE, low)))
    store = Store(Path("slip/runs"))
    store.compute([one for _, _, *cases in pairs for one in cases])
    for name, friction, *cases in pairs:
        plain_cost, cost = (slip_cost(store.run(one)) for one in cases)
        if plain_cost is None or cost is None:
            print(f"{name:20} friction {friction:g}: no whole cycles")
            continue
        saved = -percent(cost.loss_J_per_m, plain_cost.loss_J_per_m)
        faster = percent(cost.speed_m_per_s, plain_cost.speed_m_per_s)
        one_wave = store[cases[1]].rhythm.is_one_wave
        rows.append((name, friction, saved, faster, one_wave))
        wave = "" if one_wave else ", no wave"
        print(f"{name:20} friction {friction:g}: {saved:+.0f} % saved per metre, {faster:+.0f} % faster{wave}")
    if path:
        write_csv(path, ["feedback", "friction", "saved_percent", "faster_percent", "one_wave"], rows)


if __name__ == "__main__":
    main()
