from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

import build_site
import notebooks


@pytest.fixture(scope="session")
def tutorials_run_once(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Outputs of tutorials are kept for these tests only, whatever was built on this machine before."""
    base = tmp_path_factory.getbasetemp()
    # Test processes have folders of their own within one that they share.
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(notebooks.CACHE_VARIABLE, str(shared / "tutorials"))
        yield


@pytest.fixture(scope="session")
def site(tutorials_run_once: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the whole site, built strictly."""
    return build_site.build(tmp_path_factory.mktemp("build"))
