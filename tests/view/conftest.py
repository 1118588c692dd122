from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from live_page import ARGUMENTS, CHROMIUM

from annelid.config import load_config
from annelid.simulation.loop import simulate
from annelid.simulation.runfile import Run

if TYPE_CHECKING:
    from playwright.sync_api import Browser


@pytest.fixture(scope="session")
def planar_run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Three seconds of the planar worm: one cycle and a bit."""
    config = load_config("riddle2022-planar", {"duration_s": 3.0})
    return simulate(config, tmp_path_factory.mktemp("planar") / "run", progress=False)


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    return tmp_path / "picture.png"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield chromium
        chromium.close()
