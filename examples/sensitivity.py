"""Sensitivity of elongation and period to one parameter each: by how many percent per percent do they change?

    python examples/sensitivity.py [folder]

Each parameter is raised and lowered by a tenth; the worms run in processes. Read it beside the error of the numerics:
period and elongation of this preset hold to 1 or 2 % (docs/evidence/speed.md).
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rich.console import Console
from rich.table import Table

from annelid import load_config
from annelid.experiment import Case, Store

PRESET, STEP = "riddle2023-rods", 0.1
FIELDS = (
    "body.strands.young_modulus_Pa",
    "body.springs.stiffness_N_per_m",
    "body.rings.peak_force_N",
    "arena.friction",
    "controller.gate_time_constant_ms",
    "sensor.tolerance_m",
)


def main(folder: Path, duration_s: float = 6.0) -> None:
    """Runs all variants and prints the table."""
    base = load_config(PRESET, {"duration_s": duration_s})
    cases = []
    for field in FIELDS:
        value = base
        for name in field.split("."):
            value = getattr(value, name)
        changes = ({"duration_s": duration_s, field: factor * value} for factor in (1 - STEP, 1 + STEP))
        cases += [Case(PRESET, change) for change in changes]
    store = Store(folder)
    store.compute(cases)
    results = [store[case].summary for case in cases]
    table = Table("raised by 1 %", "elongation (%)", "period (%)")
    for field, low, high in zip(FIELDS, results[::2], results[1::2], strict=True):
        length = [np.mean(each.elongation_mean_max_m or np.nan) for each in (low, high)]
        period = [each.period_s or np.nan for each in (low, high)]
        slopes = (np.log(high / low) / np.log((1 + STEP) / (1 - STEP)) for low, high in (length, period))
        table.add_row(field, *(f"{slope:+.2f}" for slope in slopes))
    Console().print(table)


if __name__ == "__main__":
    with TemporaryDirectory() as temporary:
        main(Path(sys.argv[1] if len(sys.argv) > 1 else temporary))
