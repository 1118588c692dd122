"""A user's own controller by the name module:name, as a kind."""

from __future__ import annotations

from pathlib import Path

import pytest

from annelid.config import check_config
from annelid.control.user_controller import VARIABLE, own_controller
from annelid.errors import ConfigError
from annelid.experiment import Case, Store, case_key, fingerprint
from annelid.experiment.executors import Processes

OWN = """
from typing import Literal
import numpy as np
from annelid.config import ControllerKind

def clock(sensation):
    return [0.2, 0.4, 0.6]

class Counter:
    def __init__(self, n_segments, n_muscles):
        self.n = n_muscles
    def reset(self, seed):
        self.seed = seed
    def step(self, sensation):
        return np.full(self.n, 0.5)

class Kind(ControllerKind):
    kind: Literal["test-own"] = "test-own"
    level: float = 0.25
    def build(self, config, plant):
        return Counter(plant.n_segments, plant.n_muscles)

number = 3
class Nothing: ...
"""


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, forgotten_controllers: None) -> str:
    """Name of a module with controllers in the working directory."""
    name = f"own_{tmp_path.name.replace('-', '_')}"
    (tmp_path / f"{name}.py").write_text(OWN.replace("test-own", f"test-{name}"))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(VARIABLE, "")
    monkeypatch.syspath_prepend(tmp_path)
    return name


@pytest.mark.parametrize(("attribute", "level"), [("clock", 0.4), ("Kind", 0.5)])
def test_an_own_controller_runs_also_in_workers(own: str, attribute: str, level: float, tmp_path: Path) -> None:
    kind = own_controller(f"{own}:{attribute}")
    assert kind == (f"test-{own}" if attribute == "Kind" else f"{own}:{attribute}")
    assert own_controller(f"{own}:{attribute}") == kind
    case = Case("riddle2022-planar", {"duration_s": 0.02, "controller": {"kind": kind}, "trial.blind": True})
    with Processes(1) as one:
        store = Store(tmp_path / "runs", one)
        store.compute([case])
    assert store.run(case).data["activation"].values[-1, 1] == pytest.approx(level)
    before, module = case_key(case), tmp_path / f"{own}.py"
    module.write_text(module.read_text() + "other = 4\n")
    for function in (fingerprint._code_in, fingerprint.code_fingerprint, fingerprint.physics_fingerprint):
        function.cache_clear()
    assert case_key(case) != before, "another controller is another run"


def test_what_is_no_controller_is_refused(subtests: pytest.Subtests, own: str) -> None:
    for name, words in (
        ("mine", "write module:name"),
        ("mine:Con troller", "write module:name"),
        ("no_such_module:Controller", "no_such_module cannot be imported"),
        ("{own}:missing", "has nothing of that name"),
        ("{own}:number", "must be a function"),
        ("{own}:Nothing", "must be a function"),
    ):
        with subtests.test(f"{name!r:.60}"), pytest.raises(ConfigError, match=words):
            own_controller(name.format(own=own))


def test_an_error_inside_the_users_module_is_shown(own: str, tmp_path: Path) -> None:
    (tmp_path / "broken_inside.py").write_text("import math\nmath.no_such_function()\n")
    with pytest.raises(ConfigError, match=r"cannot be imported: module 'math' has no attribute"):
        own_controller("broken_inside:Controller")


def test_a_file_makes_no_controller_known(own: str) -> None:
    with pytest.raises(ConfigError, match=r"controller.*must be one of"):
        check_config({"controller": {"kind": f"{own}:clock"}, "body": {"kind": "riddle2022"}})
