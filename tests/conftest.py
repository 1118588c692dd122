"""What tests of several rooms begin with."""

from __future__ import annotations

import pytest

from annelid.config import load_config
from annelid.simulation.loop import simulate
from annelid.simulation.runfile import Run


@pytest.fixture(scope="session")
def rods_run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """The first moments of a 3D worm, segment 1 contracting."""
    config = load_config("riddle2023-rods", {"duration_s": 0.2})
    return simulate(config, tmp_path_factory.mktemp("rods") / "run", progress=False)
