from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from annelid.config import load_config
from annelid.protocols import Sensation
from annelid.simulation.loop import simulate
from annelid.simulation.runfile import Run


def squeeze(sensation: Sensation) -> np.ndarray:
    """Contracts all segments alike."""
    return np.full(len(sensation.ring_length_m), 0.5)


@pytest.fixture(scope="session")
def chain_run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A worm of capsules for a moment."""
    config = load_config("riddle2023", {"duration_s": 0.02})
    return simulate(config, tmp_path_factory.mktemp("chain") / "run", progress=False)


@pytest.fixture(scope="session")
def user_run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A 3D worm under a user's function."""
    config = load_config("riddle2023-rods", {"duration_s": 0.1})
    return simulate(config, tmp_path_factory.mktemp("user") / "run", controller=squeeze, progress=False)


@pytest.fixture(scope="session", params=["planar", "rods"])
def run(request: pytest.FixtureRequest) -> Run:
    """A planar and a 3D run."""
    return request.getfixturevalue(f"{request.param}_run")


@pytest.fixture
def target(tmp_path: Path) -> Path:
    return tmp_path / "out"
