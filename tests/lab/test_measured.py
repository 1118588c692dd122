"""A measured log: what it says of a run is found again, and each of its defects is handled or refused in a sentence."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from annelid.config import load_config
from annelid.errors import AnnelidError, ConfigError
from annelid.simulation.runfile import Run
from annelid_lab.logs import LogMap, read_map, read_measured
from annelid_lab.logs.agreement import Agreement, compare_with_log, period, run_series
from annelid_lab.logs.report import agreement_table
from synthetic import wave_data

PERIOD_S, LAG_S = 2.4, 3.1
SIGNALS = {"s1_mm": "stretch_length[1, left]", "s3_mm": "stretch_length[3, mean]", "ring (mm)": "ring_length[ring_1]"}
UNITS = {"s1_mm": 1e3, "s3_mm": 1e3, "ring (mm)": 1e3}


def smooth(time_s: np.ndarray, segment: int) -> np.ndarray:
    """A rounded pulse a period, later from segment to segment, that grows at the start so that a lag is unique."""
    phase = 2 * np.pi * (time_s / PERIOD_S - segment / 3)
    return (1 - np.exp(-time_s / 3.0)) * np.exp(2.0 * np.cos(phase) - 2.0)


@pytest.fixture(scope="module")
def run() -> Run:
    data = wave_data(duration_s=24.0, interval_s=0.02, period_s=PERIOD_S)
    data = data.assign_coords(muscle=["ring_0", "ring_1", "ring_2"])
    time = data["time"].values
    for segment in range(3):
        for sensor in range(6):
            data["stretch_length"].values[:, segment, sensor] = 0.075 + (0.05 + 0.002 * sensor) * smooth(time, segment)
        data["ring_length"].values[:, segment] = 0.96 - 0.6 * smooth(time, segment)
    for name in ("stretch_length", "ring_length", "center_of_mass"):
        data[name].attrs["units"] = "m"
    data["muscle_force"].attrs["units"] = "N"
    return Run(Path("run.nc"), {}, {}, load_config("riddle2023-rods"), "complete", "").with_data(data)


def log_of(run: Run, *, rate_Hz: float = 50.0, lag_s: float = LAG_S, drift: float = 0.0) -> pd.DataFrame:
    """A perfect log of a run from `LAG_S` on, whose clock starts at zero."""
    clock = np.arange(0.0, 17.0, 1.0 / rate_Hz)
    columns = {"t_ms": 1e3 * clock}
    for name, signal in SIGNALS.items():
        time, values, _ = run_series(run, signal)
        columns[name] = UNITS[name] * np.interp(clock / (1.0 + drift) + lag_s, time, values)
    return pd.DataFrame(columns)


def compared(run: Run, path: Path, **fields: object) -> Agreement:
    log_map = LogMap.model_validate({"time": "t_ms", "map": SIGNALS} | fields)
    return compare_with_log(run, read_measured(path, log_map))


def agreement_of(run: Run, log: pd.DataFrame, folder: Path, **fields: object) -> Agreement:
    log.to_csv(folder / "log.csv", index=False)
    return compared(run, folder / "log.csv", **fields)


@settings(max_examples=25)
@given(
    lag_s=st.floats(0.5, 5.0),
    rate_Hz=st.sampled_from([7.0, 13.3, 30.0, 100.0]),
    noise_mm=st.floats(0.0, 2.0),
    seed=st.integers(0, 2**31),
)
@example(lag_s=4.875, rate_Hz=7.0, noise_mm=0.0, seed=0)
def test_the_lag_is_found_again(
    run: Run, tmp_path_factory: pytest.TempPathFactory, lag_s: float, rate_Hz: float, noise_mm: float, seed: int
) -> None:
    log = log_of(run, rate_Hz=rate_Hz, lag_s=lag_s)
    rng = np.random.default_rng(seed)
    for name in SIGNALS:
        log[name] += rng.normal(0.0, noise_mm, len(log))
    found = agreement_of(run, log, tmp_path_factory.mktemp("log"))
    # Seven samples a second do not always tell one period from the next; that is said then.
    periods = round((found.lag_s - lag_s) / PERIOD_S)
    assert found.lag_s - periods * PERIOD_S == pytest.approx(lag_s, abs=0.03)
    assert not periods or (rate_Hz == 7.0 and any("as well" in note for note in found.notes))
    assert found.period_s == pytest.approx((PERIOD_S, PERIOD_S), rel=0.02)
    for one in found.signals.values():
        assert one.rms < 0.001 * noise_mm + 0.06 * one.amplitude[1]
        assert abs(one.phase) < 0.02
        assert one.waveform > 0.9


@pytest.mark.parametrize("drift", [-0.03, -0.004, 0.0, 0.012])
def test_a_drifting_clock_is_fitted_where_the_map_says_so(run: Run, tmp_path: Path, drift: float) -> None:
    found = agreement_of(run, log_of(run, drift=drift), tmp_path, clock_drift="free")
    assert found.clock_drift == pytest.approx(drift, abs=5e-4)
    assert all(one.rms < 0.02 * one.amplitude[1] for one in found.signals.values())


def test_a_log_that_shares_too_little_with_the_run_is_refused(run: Run, tmp_path: Path) -> None:
    end_s = float(run.data["time"].values[-1])
    for later_s, shared in ((-0.1, r"[1-9]\d?"), (5.0, "0")):
        with pytest.raises(ConfigError, match=rf"have {shared} samples of .* in common at lag_s"):
            agreement_of(run, log_of(run), tmp_path, lag_s=end_s + later_s)


def test_errors_are_those_that_were_put_in(run: Run, tmp_path: Path) -> None:
    log = log_of(run)
    log["s1_mm"] = 1.5 * (log["s1_mm"] - 75.0) + 80.0
    late, _, _ = run_series(run, SIGNALS["s3_mm"])
    third = run_series(run, SIGNALS["s3_mm"])[1]
    log["s3_mm"] = 1e3 * np.interp(log["t_ms"] / 1e3 + LAG_S - 0.1 * PERIOD_S, late, third)
    found = agreement_of(run, log, tmp_path, lag_s=LAG_S)
    one, three = found.signals["s1_mm"], found.signals["s3_mm"]
    assert one.amplitude[0] == pytest.approx(1.5 * one.amplitude[1], rel=0.01)
    assert one.bias < -0.005
    assert one.phase == 0.0
    assert three.phase == pytest.approx(0.1, abs=0.01)
    assert three.waveform > 0.99
    assert found.signals["ring (mm)"].rms < 1e-3


Change = Callable[[pd.DataFrame], pd.DataFrame]


def with_cells(log: pd.DataFrame, name: str, rows: slice, value: object) -> pd.DataFrame:
    changed = log.copy()
    changed[name] = changed[name].astype(object)
    changed.loc[rows.start : rows.stop, name] = value
    return changed


HANDLED: dict[str, tuple[Change, dict[str, object], str]] = {
    "a gap": (lambda log: with_cells(log, "s1_mm", slice(100, 140), np.nan), {}, "% missing"),
    "words for a gap": (lambda log: with_cells(log, "s1_mm", slice(100, 140), "NaN"), {}, "% missing"),
    "outliers": (lambda log: with_cells(log, "s3_mm", slice(60, 61), 4095.0), {}, "outliers"),
    "jitter": (lambda log: log.sample(frac=0.6, random_state=1).sort_index(), {}, "not evenly spaced"),
    "times twice": (lambda log: pd.concat([log, log.iloc[40:45]]).sort_values("t_ms"), {}, "repeat a time"),
    "rows without a time": (lambda log: with_cells(log, "t_ms", slice(30, 32), np.nan), {}, "without a time"),
    "another zero of the clock": (lambda log: log.assign(t_ms=log["t_ms"] + 5e7), {}, ""),
    "an offset": (
        lambda log: log.assign(s1_mm=log["s1_mm"] + 12.0),
        {"map": SIGNALS | {"s1_mm": {"signal": SIGNALS["s1_mm"], "offset": "free"}}},
        "",
    ),
    "the other sign": (
        lambda log: log.assign(s1_mm=-log["s1_mm"]),
        {"map": SIGNALS | {"s1_mm": {"signal": SIGNALS["s1_mm"], "scale": -1.0}}},
        "",
    ),
    "a clock that drifts": (lambda log: log.assign(t_ms=1.01 * log["t_ms"]), {"clock_drift": "free"}, ""),
}


def test_a_defect_is_handled_and_noted(subtests: pytest.Subtests, run: Run, tmp_path: Path) -> None:
    for defect in HANDLED:
        with subtests.test(f"{defect!r:.60}"):
            folder = Path(tempfile.mkdtemp(dir=tmp_path))
            change, fields, words = HANDLED[defect]
            found = agreement_of(run, change(log_of(run)), folder, **fields)
            assert all(one.rms < 0.03 * one.amplitude[1] for one in found.signals.values())
            assert words in " ".join(found.notes)
            assert bool(found.notes) == bool(words)


REFUSED: dict[str, tuple[Change, dict[str, object], str]] = {
    "a cell that is no number": (
        lambda log: with_cells(log, "s1_mm", slice(7, 7), "ERR"),
        {},
        "row 8 of 's1_mm'.*'ERR'",
    ),
    "a wrong unit": (lambda log: log.assign(s1_mm=log["s1_mm"] / 1e3), {}, "is its unit right"),
    "another quantity": (
        lambda log: log,
        {"map": {"s1_mm": {"signal": "muscle_force[ring_0]", "unit": "mm"}}},
        "s1_mm is in m, .* in N: give a scale",
    ),
    "no unit": (
        lambda log: log.rename(columns={"s1_mm": "first"}),
        {"map": {"first": "ring_length[ring_0]"}},
        "the unit of column 'first'",
    ),
    "an unknown unit": (
        lambda log: log,
        {"map": {"s1_mm": {"signal": "ring_length[ring_0]", "unit": "furlong"}}},
        "'furlong' is no known unit: .*mm",
    ),
    "a time that goes back": (lambda log: pd.concat([log, log]), {}, "goes back, from 16.98 to 0 s"),
    "a clock that is too coarse": (lambda log: log.assign(t_ms=log["t_ms"] // 100 * 100), {}, "repeat the time"),
    "no such column": (lambda log: log.drop(columns="s3_mm"), {}, "no column 's3_mm': .*s1_mm"),
    "no time": (lambda log: log.drop(columns="t_ms"), {}, "no column 't_ms'"),
    "a time without a unit": (
        lambda log: log.rename(columns={"t_ms": "t"}),
        {"time": "t"},
        "_s, or write time_unit = .s",
    ),
    "a column twice": (lambda log: log.rename(columns={"s3_mm": "s1_mm"}), {}, "two columns 's1_mm'"),
    "mostly gaps": (lambda log: with_cells(log, "s1_mm", slice(100, 800), np.nan), {}, "no number in 8. %"),
    "too short": (lambda log: log.iloc[:12], {}, "too short to compare"),
    "no rows": (lambda log: log.iloc[:0], {}, "has no rows"),
}


def test_a_defect_is_refused_in_a_sentence(subtests: pytest.Subtests, run: Run, tmp_path: Path) -> None:
    for defect in REFUSED:
        with subtests.test(f"{defect!r:.60}"):
            folder = Path(tempfile.mkdtemp(dir=tmp_path))
            change, fields, words = REFUSED[defect]
            with pytest.raises(AnnelidError, match=words) as refused:
                agreement_of(run, change(log_of(run)), folder, **fields)
            assert "\n" not in str(refused.value)


def test_a_sensor_that_never_changes_is_noted_and_the_others_are_compared(run: Run, tmp_path: Path) -> None:
    found = agreement_of(run, log_of(run).assign(s3_mm=75.0), tmp_path)
    assert "s3_mm never changes: a sensor that was not connected?" in found.notes
    assert found.signals["s1_mm"].waveform > 0.99
    assert np.isnan(found.signals["s3_mm"].waveform)
    assert json.loads(json.dumps(found.to_dict(), allow_nan=False))["signals"]["s3_mm"]["phase"] is None
    lines = agreement_table(found).splitlines()
    assert [line.split("  ")[0] for line in lines[1:-2:2]] == list(found.signals), "a line measured, one simulated"
    assert max(map(len, lines)) <= 80, "\n".join(lines)


def test_another_period_is_noted_and_not_taken_for_drift(run: Run, tmp_path: Path) -> None:
    found = agreement_of(run, log_of(run, drift=0.04), tmp_path)
    assert found.clock_drift == 0.0
    assert any("a difference of +4" in note for note in found.notes)


def test_a_lag_that_fits_as_well_is_named(run: Run, tmp_path: Path) -> None:
    """Once the worm has started, a log of three periods fits one period later, too."""
    found = agreement_of(run, log_of(run, lag_s=9.0).iloc[:360], tmp_path)
    (note,) = found.notes
    assert note.startswith("a lag of ")
    other_s = float(note.split()[3])
    assert (found.lag_s - 9.0) / PERIOD_S == pytest.approx(round((found.lag_s - 9.0) / PERIOD_S), abs=0.02)
    assert abs(other_s - found.lag_s) == pytest.approx(PERIOD_S, abs=0.05)


def test_a_wrong_last_time_is_refused_before_memory_is_filled(run: Run, tmp_path: Path) -> None:
    log = log_of(run)
    log.loc[log.index[-1], "t_ms"] = 1e18
    with pytest.raises(ConfigError, match=r"too long to compare.*is a time in it wrong"):
        agreement_of(run, log, tmp_path)


def test_a_tracked_point_travels_along_its_net_motion(run: Run, tmp_path: Path) -> None:
    time, travel, unit = run_series(run, "travel")
    assert unit == "m"
    assert travel[-1] == pytest.approx(0.24)
    frames = np.arange(0.0, 17.0, 0.04)
    ahead = 1e3 * np.interp(frames, time, travel) + 3.0 * np.sin(2 * np.pi * frames / PERIOD_S)
    pd.DataFrame({"head_x": 50 + 0.6 * ahead, "head_y": 90 - 0.8 * ahead}).to_csv(tmp_path / "log.csv", index=False)
    given_map = {"rate_Hz": 25.0, "time": None, "m_per_px": 1e-3, "lag_s": 0.0, "map": {"head": "travel"}}
    assert compared(run, tmp_path / "log.csv", **given_map).signals["head"].rms < 0.004


def test_travel_counts_from_anywhere_and_one_that_goes_backward_is_noted(run: Run, tmp_path: Path) -> None:
    log = log_of(run)
    time, travel, _ = run_series(run, "travel")
    log["x_mm"] = 509.3 + 1e3 * np.interp(log["t_ms"] / 1e3 + LAG_S, time, travel)
    fields: dict[str, object] = {"map": {"x_mm": "travel"}, "lag_s": LAG_S}
    found = agreement_of(run, log, tmp_path, **fields)
    assert found.signals["x_mm"].rms < 1e-4
    assert "backward" not in " ".join(found.notes)
    found = agreement_of(run, log.assign(x_mm=-log["x_mm"]), tmp_path, **fields)
    assert any("x_mm goes backward" in note for note in found.notes)


def test_a_reference_that_is_none_is_refused(subtests: pytest.Subtests, run: Run) -> None:
    for reference, words in (
        ("stretch_lenght[1, left]", "no signal 'stretch_lenght'.*stretch_length"),
        ("stretch_length[1]", "a label for each of segment, sensor"),
        ("stretch_length[4, left]", "unknown segment '4', it is one of 1, 2, 3, mean"),
        ("stretch_length[1, top]", "unknown sensor 'top', it is one of 0, 1, 2, 3, 4, 5, left, right, mean"),
        ("stretch_length[mean, left]", "name a segment"),
        ("stretch_length[1, left", "no signal"),
    ):
        with subtests.test(f"{reference!r:.60}"), pytest.raises(ConfigError, match=words):
            run_series(run, reference)


def test_a_map_that_is_none_is_refused(subtests: pytest.Subtests, tmp_path: Path) -> None:
    for text, words in (
        ("time = 't'\n[map]\n", "maps no column"),
        ("[map]\na = 'ring_length[ring_0]'\n", "needs either time"),
        ("time = 't'\nrate_Hz = 3\n[map]\na = 'x'\n", "needs either time"),
        ("time = 't'\n[map.a]\nsignal = 'x'\nunti = 'mm'\n", "unti"),
        ("time = 't'\nclock_drift = 3\n[map]\na = 'x'\n", "clock_drift"),
        ("time = ", "TOML"),
    ):
        with subtests.test(f"{text!r:.60}"):
            folder = Path(tempfile.mkdtemp(dir=tmp_path))
            (folder / "map.toml").write_text(text)
            with pytest.raises(ConfigError, match=words):
                read_map(folder / "map.toml")


@given(st.floats(8.0, 60.0), st.integers(0, 2**31))
def test_the_period_of_a_wave_is_found_and_noise_has_none(samples: float, seed: int) -> None:
    at = np.arange(400.0)
    waves = np.stack([np.exp(np.cos(2 * np.pi * at / samples + shift)) for shift in (0.0, 1.0)])
    assert period(waves) == pytest.approx(samples, rel=0.02)
    assert np.isnan(period(np.random.default_rng(seed).normal(size=(3, 400))))
