"""A step costs as many instructions as before."""

from __future__ import annotations

import importlib.util
import json
import shutil
from pathlib import Path

import pytest

TOLERATED = 0.1
BEFORE = Path(__file__).with_name("instructions.json")
BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "instructions.py"


@pytest.mark.skipif(shutil.which("valgrind") is None, reason="valgrind is not installed")
def test_a_step_costs_as_many_instructions_as_before() -> None:
    """A cheaper step fails too: counts that are too high hide the next slowdown."""
    spec = importlib.util.spec_from_file_location("instructions", BENCHMARK)
    assert spec is not None
    assert spec.loader is not None
    benchmark = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(benchmark)
    before, here = json.loads(BEFORE.read_text(encoding="utf-8")), benchmark.counted_with()
    if here != before["counted_with"]:
        pytest.skip(f"instructions of {here} cannot be compared with those of {before['counted_with']}")
    assert benchmark.counted_step() == pytest.approx(before["step"], rel=TOLERATED), (
        f"if this is meant: python benchmarks/instructions.py --step > tests/studies/{BEFORE.name}"
    )
