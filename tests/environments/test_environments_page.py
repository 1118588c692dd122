"""The page about environments says what they are."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import numpy as np
import pytest

from annelid.environments import WormEnv
from annelid.environments.task import WEIGHTS

PAGE = (Path(__file__).parents[2] / "docs" / "environments.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def env() -> WormEnv:
    return WormEnv()


def test_the_table_is_that_of_the_space(env: WormEnv) -> None:
    assert env.layout.table() in PAGE
    assert f"`Box(.., ({env.layout.size},), float32)`" in PAGE


def test_every_weight_and_all_that_info_says_is_there(env: WormEnv) -> None:
    for name, value in WEIGHTS.items():
        assert re.search(rf"\| `reward_{name}` \|.*\| {value:g} \|", PAGE), name
    env.reset(seed=0)
    for name in env.step(np.zeros(6))[4]:
        assert f"`{name}`" in PAGE, name


def test_every_option_is_there_with_its_default() -> None:
    for name, parameter in inspect.signature(WormEnv).parameters.items():
        default = parameter.default
        shown = f'`"{default}"`' if isinstance(default, str) else f"`{default}`"
        assert f"| `{name}` | {shown} |" in PAGE, name
