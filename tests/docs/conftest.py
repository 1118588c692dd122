from __future__ import annotations

import os
from pathlib import Path

import pytest

import build_site
import notebooks


@pytest.fixture(scope="session")
def tutorials_run_once(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Outputs of tutorials are kept for these tests only, whatever was built on this machine before."""
    os.environ[notebooks.CACHE_VARIABLE] = str(tmp_path_factory.mktemp("tutorials"))


@pytest.fixture(scope="session")
def site(tutorials_run_once: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the whole site, built strictly."""
    return build_site.build(tmp_path_factory.mktemp("build"))
