"""A map proposed for a log reads it right once its user has stated what the log does not say, and guesses nothing."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.errors import AnnelidError, ConfigError
from annelid_lab.logs import proposed_map, read_map, read_measured

TIMES_MS = np.arange(0, 2000, 40)
LENGTHS_MM = 147.0 + 10.0 * np.sin(TIMES_MS / 300.0)


def rows(*columns: np.ndarray, separator: str = ",") -> str:
    return "\n".join(separator.join(f"{cell:.6g}" for cell in row) for row in np.stack(columns, axis=1)) + "\n"


LOGS = {
    "logger": (
        "Logger v2.1\nSerial;00123\nt_ms;seg0_left_mm;seg1_left_mm;battery_V\n"
        + rows(TIMES_MS, LENGTHS_MM, LENGTHS_MM, 0 * TIMES_MS, separator=";"),
        {},
        {"seg0_left_mm": ("stretch_length[1, left]", 1e-3 * LENGTHS_MM),
         "seg1_left_mm": ("stretch_length[2, left]", 1e-3 * LENGTHS_MM)},
    ),
    "a student's Arduino": (
        "millis,seg1_length_mm,Length 2 (mm),PWM3\n" + rows(TIMES_MS, LENGTHS_MM, LENGTHS_MM, 0 * TIMES_MS),
        {},
        {"seg1_length_mm": ("stretch_length[1, mean]", 1e-3 * LENGTHS_MM),
         "Length 2 (mm)": ("stretch_length[2, mean]", 1e-3 * LENGTHS_MM)},
    ),
    "a lone point": (
        "Elapsed Time (s),x_mm,y_mm\n" + rows(1e-3 * TIMES_MS, TIMES_MS, 0 * TIMES_MS),
        {},
        {"x_mm": ("travel", 1e-3 * TIMES_MS)},
    ),
    "tracker": (
        "scorer,net,net,net\nbodyparts,head,head,head\ncoords,x,y,likelihood\n"
        + rows(TIMES_MS / 40, TIMES_MS, 0 * TIMES_MS, 1 + 0 * TIMES_MS),
        {"rate_Hz": 25, "m_per_px": 1e-3},
        {"head": ("travel", 1e-3 * TIMES_MS)},
    ),
    "TRex": (
        "frame,time_s,X#wcentroid (cm),Y#wcentroid (cm),missing\n"
        + rows(TIMES_MS / 40, 1e-3 * TIMES_MS, 50.0 + 0.1 * TIMES_MS, 0 * TIMES_MS, 0 * TIMES_MS),
        {},
        {"wcentroid": ("travel", 1e-3 * TIMES_MS)},
    ),
    "motion capture": (
        "Format Version,1.23,Capture Frame Rate,25.0,Length Units,Millimeters\nFrame,Time (Seconds),head.X,head.Y\n"
        + rows(TIMES_MS / 40, 1e-3 * TIMES_MS, TIMES_MS, 0 * TIMES_MS),
        {},
        {"head": ("travel", 1e-3 * TIMES_MS)},
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", LOGS)
def test_a_proposed_map_reads_the_log_right(kind: str, tmp_path: Path) -> None:
    text, stated, expected = LOGS[kind]
    (tmp_path / "log.csv").write_text(text)
    proposal, missing = proposed_map(tmp_path / "log.csv")
    assert [phrase.partition(",")[0] for phrase in missing] == list(stated)
    for name, value in stated.items():
        line = next(line for line in proposal.splitlines() if line.startswith(f"# {name} = "))
        proposal = proposal.replace(line, f"{name} = {value}")
    (tmp_path / "map.toml").write_text(proposal)
    read = read_measured(tmp_path / "log.csv", read_map(tmp_path / "map.toml"))
    np.testing.assert_allclose(read.time_s, TIMES_MS / 1e3)
    assert {name: column.signal for name, column in read.columns.items()} == {n: s for n, (s, _) in expected.items()}
    for name, (_, values) in expected.items():
        np.testing.assert_allclose(read.values[name], values, rtol=1e-4, atol=1e-6)


def test_a_number_at_the_end_of_a_name_is_no_unit(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t_s,seg_1,seg_2\n" + rows(*(np.arange(30.0) + shift for shift in range(3))))
    proposal, missing = proposed_map(tmp_path / "log.csv")
    assert tomllib.loads(proposal)["map"]["seg_2"] == {"signal": "stretch_length[2, mean]", "unit": "?"}
    assert missing == ['the unit of "seg_1"', 'the unit of "seg_2"']
    (tmp_path / "map.toml").write_text(proposal)
    with pytest.raises(ConfigError, match=r"unit = '\?' is no known unit"):
        read_measured(tmp_path / "log.csv", read_map(tmp_path / "map.toml"))


def test_counts_of_a_potentiometer_need_a_scale(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("millis,pot1,pot2\n" + rows(TIMES_MS, TIMES_MS, TIMES_MS))
    proposal, missing = proposed_map(tmp_path / "log.csv")
    column = {"signal": "stretch_length[1, mean]", "unit": "1", "offset": "free", "scale": "?"}
    assert tomllib.loads(proposal)["map"]["pot1"] == column
    assert missing == [f'scale, the metres in a count, of "pot{n}"' for n in (1, 2)]
    (tmp_path / "map.toml").write_text(proposal)
    with pytest.raises(ConfigError, match=r"scale"):
        read_map(tmp_path / "map.toml")


def test_an_example_for_a_name_that_is_not_recognised_is_toml_once_uncommented(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t_s,a,b\n" + rows(*(np.arange(30.0) + shift for shift in range(3))))
    proposal, missing = proposed_map(tmp_path / "log.csv")
    assert missing == ["what the columns are, under [map]; docs/how_to/measured_data.md lists the signals"]
    completed = tomllib.loads(proposal.replace('# "', '"'))["map"]
    assert {name: column["unit"] for name, column in completed.items()} == {"a": "mm", "b": "mm"}


def test_several_animals_and_unknown_units_are_left_to_the_user(tmp_path: Path) -> None:
    names = "time,a.head.x,a.head.y,b.head.x,b.head.y\n"
    (tmp_path / "log.csv").write_text(names + rows(*(np.arange(30.0) + shift for shift in range(5))))
    proposal, missing = proposed_map(tmp_path / "log.csv")
    assert len(missing) == 3, missing
    assert not {"individual", "time_unit", "m_per_px"} & tomllib.loads(proposal).keys()


@settings(max_examples=40)
@given(name=st.text(st.characters(codec="utf-8"), min_size=1, max_size=30))
def test_any_names_make_a_map_that_is_toml(name: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    log = tmp_path_factory.mktemp("log") / "log.csv"
    quoted = '"' + name.replace('"', '""') + '"'
    log.write_text(f"t_s,s1_mm,{quoted}\n" + rows(*(np.arange(30.0) + shift for shift in range(3))), encoding="utf-8")
    try:
        proposal, _ = proposed_map(log)
    except AnnelidError:
        return
    # A line feed within a name ends the header.
    assert tomllib.loads(proposal)["map"].get("s1_mm", "stretch_length[1, mean]") == "stretch_length[1, mean]"
