"""The paper's figures drawn anew, one module each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from annelid_studies.papers.words import filled, texts

FIGURES_TOML = "riddle2023/figures/figures.toml"


def caption(number: int, values: Mapping[str, Any] | None = None) -> str:
    """Returns the caption of a figure, by the paper's number."""
    return filled(texts(FIGURES_TOML)[str(number)]["caption"], values or {})
