from __future__ import annotations

from pathlib import Path

import jupytext
import pytest

import build_site
import notebooks


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The whole site, built strictly; its tutorials, which have tests of their own, are not run for it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(notebooks.CACHE_VARIABLE, str(tmp_path_factory.mktemp("tutorials")))
        patch.setattr(notebooks, "executed", lambda text: jupytext.reads(text, fmt="md"))
        return build_site.build(tmp_path_factory.mktemp("build"))
