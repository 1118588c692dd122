from __future__ import annotations

from pathlib import Path

import pytest

from annelid.config import load_config
from annelid.simulation.loop import simulate
from annelid.simulation.runfile import Run


@pytest.fixture(scope="session")
def planar_run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Three seconds of the planar worm: one cycle and a bit."""
    config = load_config("riddle2022-planar", {"duration_s": 3.0})
    return simulate(config, tmp_path_factory.mktemp("planar") / "run", progress=False)


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    return tmp_path / "picture.png"
