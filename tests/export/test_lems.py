"""Networks as LEMS: read back to the last bit, run by pyLEMS to the same potentials, and read warily."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from annelid.cli import app
from annelid.errors import ConfigError
from annelid.export import lems_text, read_lems, write_lems
from annelid.nervous import GapJunction, Network, Neuron, PeristalsisParameters, Synapse, peristalsis_network

BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "lems.py"


@pytest.fixture(scope="module")
def benchmark() -> ModuleType:
    sys.path.insert(0, str(BENCHMARK.parent))
    try:
        return importlib.import_module("lems_in_other_simulators")
    finally:
        sys.path.remove(str(BENCHMARK.parent))
