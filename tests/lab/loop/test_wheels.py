"""Wheels that wind a worm's cables: speed words to lengths, with slack, under load."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from annelid.errors import ConfigError
from annelid.protocols import Sensation
from annelid_lab.loop import Wheels, Wiring

BESIDE = Path(__file__).parents[3] / "examples" / "laboratory_firmware"
UNIT_TURNS_PER_S = 0.1 / 60
ONE_TURN = Wiring(0, -4096, protocol=1, is_wheel=True, rpm_per_unit=0.1)


def wound(wheels: Wheels, time_s: float, tension_N: float = 0.0) -> list[float]:
    """Returns the activation after a time under a tension."""
    nothing, tension = np.zeros((1, 1)), np.full(2, tension_N)
    return wheels.step(Sensation(time_s, nothing, nothing, tension, tension, nothing, nothing[0])).tolist()


def test_a_cable_that_is_paid_out_is_slack_and_is_wound_first() -> None:
    words = [(0.0, 7, 300), (0.0, 9, 1024 + 300), (1.0, 7, 1024 + 400), (1.0, 9, 0)]
    wheels = Wheels(words, (7, 9), ONE_TURN, cable_m=0.1)
    assert wound(wheels, 0.0) == [0.0, 0.0]
    assert wound(wheels, 1.0) == pytest.approx([0.0, 300 * UNIT_TURNS_PER_S])
    assert wheels.robot.contraction[0] == pytest.approx(-300 * UNIT_TURNS_PER_S)
    assert wound(wheels, 1.75) == pytest.approx([0.0, 300 * UNIT_TURNS_PER_S])
    assert wound(wheels, 2.0) == pytest.approx([100 * UNIT_TURNS_PER_S, 300 * UNIT_TURNS_PER_S])
    wheels.reset(0)
    assert wound(wheels, 0.0) == [0.0, 0.0]


def test_a_cable_slows_a_share_of_output_that_winds_and_not_a_wheel_that_is_stopped() -> None:
    wheels = Wheels([(0.0, 1, 1024 + 400)], (1, 2), ONE_TURN, cable_m=0.1, stall_torque_Nm=2.0)
    wound(wheels, 0.0)
    load = 1023 * 20.0 * (0.1 / (2 * np.pi)) / 2.0
    assert wound(wheels, 1.0, 20.0) == pytest.approx([(400 - load) * UNIT_TURNS_PER_S, 0.0])


def test_goal_velocities_of_protocol_2_wind_and_pay_out() -> None:
    wiring = Wiring(0, 4096, protocol=2, is_wheel=True)
    wheels = Wheels([(0.0, 1, 100), (1.0, 1, -40)], (1, 2), wiring, cable_m=0.1)
    assert [wound(wheels, time_s)[0] for time_s in (0.0, 1.0, 2.0)] == pytest.approx(
        [0.0, 100 * 0.229 / 60, 60 * 0.229 / 60]
    )


def test_a_wheel_stalls_where_its_segment_is_at_its_narrowest() -> None:
    wheels = Wheels([(0.0, 1, 1024 + 1000), (1.0, 1, 300)], (1, 2), ONE_TURN, cable_m=0.1)
    assert [wound(wheels, time_s)[0] for time_s in (0.0, 1.0, 2.0)] == pytest.approx(
        [0.0, 1.0, 1.0 - 300 * UNIT_TURNS_PER_S]
    )


@pytest.mark.parametrize(
    ("word", "changes", "says"),
    [
        ((0.0, 1, 5), {"is_wheel": False, "contracted": 9}, "is_wheel is False"),
        ((0.0, 3, 5), {}, r"words are for \[3\]"),
        ((0.0, 1, 5), {"rpm_per_unit": 0.0}, "rpm_per_unit must be more than 0"),
    ],
)
def test_wheels_that_cannot_be_are_refused(word: tuple[float, int, int], changes: dict[str, Any], says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        Wheels([word], (1, 2), replace(ONE_TURN, **changes), cable_m=0.1)


@pytest.mark.skipif(shutil.which("c++") is None, reason="there is no C++ compiler called c++")
def test_a_sketch_says_its_words_in_simulated_time(tmp_path: Path) -> None:
    command = ["c++", "-x", "c++", f"-I{BESIDE}", str(BESIDE / "bend.ino"), "-o", str(tmp_path / "sketch")]
    subprocess.run(command, check=True)
    done = subprocess.run([str(tmp_path / "sketch")], check=True, capture_output=True, text=True, timeout=10)
    words = [tuple(map(int, line.split())) for line in done.stdout.splitlines()]
    assert words[0] == (0, 1, 0x400 + 700)
    assert words[13:15] == [(1_700_000, 2, 0x400 + 700), (1_700_000, 1, 700)]
    assert [time_us for time_us, _, word in words if word == 0x400 + 700] == [1_700_000 * phase for phase in range(6)]
    assert words[-1] == (10_200_000, 12, 0)
