"""Files as people bring them: the right numbers at the right times, or a refusal that says what to do."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pytest
import xarray
from scipy.io import savemat

from annelid.errors import AnnelidError, UnreadableText
from annelid_lab.logs import LogMap, Measured, read_measured

S1_MM = np.array([147.2299, 146.7013, 0.0, -3.25, 146.0289, 145.8224, 145.6652, 135.8103, 112.5207, 95.1538])
TIME_MS = 40 * np.arange(25, 35)
"""Beyond a second, so that thousands have a separator."""
HEAD = np.stack([300.0 + np.arange(10.0), 250.0 - np.arange(10.0)], axis=1)
TAIL = np.stack([509.0 + 2.0 * np.arange(10.0), 262.5 - np.arange(10.0)], axis=1)
DISTANCE = np.hypot(209.0 + np.arange(10.0), 12.5)


def read(folder: Path, name: str, content: str | bytes, **fields: Any) -> Measured:
    (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
    return read_measured(folder / name, LogMap.model_validate(fields))


def rows(separator: str = ",", decimal: str = ".", cell: Callable[[str], str] = str, times: Sequence[str] = ()) -> str:
    """The rows of a table; with times, these in place of milliseconds."""
    texts = times or [str(time) for time in TIME_MS]
    values = [f"{value:.4f}".replace(".", decimal) for value in S1_MM]
    return "\n".join(separator.join(map(cell, pair)) for pair in zip(texts, values, strict=True)) + "\n"


SECONDS = [f"{time / 1e3:06.3f}" for time in TIME_MS]
MAP: dict[str, Any] = {"time": "t_ms", "map": {"s1_mm": "stretch_length[1, mean]"}}
AS_WORDS = {"time": "t", "map": {"s1": {"signal": "stretch_length[1, mean]"}}}
TEXTS: dict[str, tuple[str | bytes, dict[str, Any]]] = {
    "commas": ("t_ms,s1_mm\n" + rows(), {}),
    "semicolons and decimal commas": ("t_ms;s1_mm\n" + rows(";", ","), {}),
    "tabs, a comment above": ("# made by a logger\nt_ms\ts1_mm\n" + rows("\t"), {}),
    "spaces": ("t_ms  s1_mm\n" + rows("   "), {}),
    "a byte order mark": ("\ufefft_ms,s1_mm\n" + rows(), {}),
    "Excel's line sep=": ("sep=;\nt_ms;s1_mm\n" + rows(";", ","), {}),
    "a row of units": ("t;s1\nms;mm\n" + rows(";", ","), AS_WORDS),
    "Windows' letters": (("t_ms;s1_mm;T (°C)\n" + rows(";", ",").replace("\n", ";21,5\n")).encode("cp1252"), {}),
    "UTF-16": (("t_ms\ts1_mm\n" + rows("\t", ",")).encode("utf-16"), {}),
    "quoted decimal commas": ('"t_ms","s1_mm"\n' + rows(",", ",", '"{}"'.format), {}),
    "a preamble": ("Logger v2\nSerial;00123\nDate;01.05.2024\n\nt_ms;s1_mm\n" + rows(";", ","), {}),
    "points for thousands": (
        "t_ms;s1_mm\n" + rows(";", ",", times=[f"{time:,}".replace(",", ".") for time in TIME_MS.tolist()]),
        {},
    ),
    "a comment sign before the header": ("# t_ms,s1_mm\n" + rows(), {}),
    "MATLAB's comment sign": ("% t_ms s1_mm\n" + rows(" "), {}),
    "a comment sign in a cell": ("t_ms,s1_mm,note\n" + rows().replace("\n", ",#3\n"), {}),
    "ends of lines with separators": ("t_ms,s1_mm,\n" + rows().replace("\n", ",\n"), {}),
    "the Arduino monitor": (
        "".join(f"10:00:01.000 -> {line}\n" for line in ("t_ms,s1_mm\n" + rows()).splitlines()),
        {},
    ),
    "micro": ("t_µs,s1_mm\n" + rows(times=[f"{time}000" for time in TIME_MS]), {"time": "t_µs"}),
    "a clock": ("T,s1_mm\n" + rows(times=[f"10:00:{time}" for time in SECONDS]), {"time": "T"}),
    "ISO dates": ("T,s1_mm\n" + rows(times=[f"2024-05-01T10:00:{time}" for time in SECONDS]), {"time": "T"}),
    "Python's dates": (
        "T;s1_mm\n" + rows(";", times=[f"2024-05-01 10:00:{time}".replace(".", ",") for time in SECONDS]),
        {"time": "T"},
    ),
    "German dates": ("T;s1_mm\n" + rows(";", ",", times=[f"01.05.2024 10:00:{s}" for s in SECONDS]), {"time": "T"}),
    "US dates": ("T,s1_mm\n" + rows(times=[f"05/31/2024 10:00:{s}" for s in SECONDS]), {"time": "T"}),
    "two names in a row above": (",Worm\nt_ms,s1_mm\n" + rows(), {}),
}


def test_a_text_is_read_however_it_is_written(subtests: pytest.Subtests, tmp_path: Path) -> None:
    for case, (content, fields) in TEXTS.items():
        with subtests.test(case):
            log = read(tmp_path, "log.csv", content, **MAP | fields)
            (values,) = log.values.values()
            assert values == pytest.approx(1e-3 * S1_MM, abs=1e-9)
            assert log.time_s - log.time_s[0] == pytest.approx(0.04 * np.arange(10), abs=1e-9)


def test_binary_tables_are_read(subtests: pytest.Subtests, tmp_path: Path) -> None:
    table = pd.DataFrame({"t_ms": TIME_MS.astype(float), "s1_mm": S1_MM})
    arrays = {name: table[name].to_numpy() for name in table}
    table.to_parquet(tmp_path / "log.parquet")
    savemat(tmp_path / "vectors.mat", arrays | {"rig": "A", "gain": 2.0})
    savemat(tmp_path / "struct.mat", {"log": arrays})
    with h5py.File(tmp_path / "new.mat", "w", userblock_size=512) as file:
        for name, values in arrays.items():
            file[name] = values[None]
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
    with (tmp_path / "new.mat").open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM")
    table.set_index("t_ms").to_xarray().to_netcdf(tmp_path / "log.nc", engine="h5netcdf")
    (tmp_path / "log.csv.gz").write_bytes(gzip.compress(table.to_csv(index=False).encode()))
    for path in tmp_path.iterdir():
        with subtests.test(path.name):
            log = read_measured(path, LogMap.model_validate(MAP))
            assert log.time_s == pytest.approx(1e-3 * TIME_MS)
            assert log.values["s1_mm"][:4] == pytest.approx(1e-3 * S1_MM[:4])


FRAME, ZERO = np.arange(10.0)[:, None], np.zeros((10, 1))
SURE, UNSURE = np.full((10, 1), 0.99), np.where(FRAME == 3, 0.1, 0.99)
HIGH = np.full((10, 1), 30.0)
DEEP = np.hypot(DISTANCE, 30.0)
GAP = np.where(np.arange(10) == 3, np.nan, DISTANCE)
PX = {"m_per_px": 1e-3}
BODY_PARTS, COORDS = "bodyparts" + ",head" * 3 + ",tail" * 3, "coords" + ",x,y,likelihood" * 2
Track = tuple[tuple[str, ...], tuple[np.ndarray, ...], dict[str, Any], np.ndarray]
TRACKS: dict[str, Track] = {
    "columns": (("head_x,head_y,tail_x,tail_y",), (HEAD, TAIL), PX, DISTANCE),
    "columns with units": (("head_x_mm,head_y_mm,tail_x_mm,tail_y_mm",), (HEAD, TAIL), {}, DISTANCE),
    "TRex": (("X#head (mm),Y#head (mm),X#tail (mm),Y#tail (mm)",), (HEAD, TAIL), {}, DISTANCE),
    "three dimensions": (("head X,head Y,head Z,tail X,tail Y,tail Z",), (HEAD, ZERO, TAIL, HIGH), PX, DEEP),
    "confidence": (("head_x,head_y,head_conf,tail_x,tail_y",), (HEAD, UNSURE, TAIL), PX, GAP),
    "DeepLabCut": (("scorer" + ",net" * 6, BODY_PARTS, COORDS), (FRAME, HEAD, UNSURE, TAIL, SURE), PX, GAP),
    "one of two worms": (
        ("scorer" + ",net" * 8, "individuals" + ",worm1" * 4 + ",worm2" * 4,
         "bodyparts" + ",head,head,tail,tail" * 2, "coords" + ",x,y" * 4),
        (FRAME, HEAD, TAIL, TAIL, TAIL), PX | {"individual": "worm1"}, DISTANCE,
    ),
    "SLEAP": (
        ("track,frame_idx,instance.score,head.x,head.y,head.score,tail.x,tail.y,tail.score",),
        (ZERO, FRAME, SURE, HEAD, UNSURE, TAIL, SURE), PX, GAP,
    ),
    "OptiTrack": (
        ("Format Version,1.23", ",," + ",".join(["Marker"] * 6), ",,head,head,head,tail,tail,tail", ",,A,A,A,B,B,B",
         "Frame,Time (Seconds)" + ",X,Y,Z" * 2),
        (FRAME, 0.04 * FRAME, HEAD, ZERO, TAIL, HIGH),
        {"rate_Hz": None, "time": "Time (Seconds)", "time_unit": "s"} | PX, DEEP,
    ),
    "Vicon": (
        ("Trajectories", "25", ",,head,,,tail,,", "Frame,Sub Frame" + ",X,Y,Z" * 2, ",," + ",".join(["mm"] * 6)),
        (FRAME, ZERO, HEAD, ZERO, TAIL, HIGH), {}, DEEP,
    ),
}  # fmt: skip
TO_TAIL = {"rate_Hz": 25.0, "map": {"head": {"signal": "ring_distance[1]", "distance_to": "tail"}}}


def track_text(lines: Sequence[str], cells: Sequence[np.ndarray]) -> str:
    table = np.column_stack(cells).tolist()
    return "\n".join([*lines, *(",".join(f"{cell:g}" for cell in row) for row in table)]) + "\n"


def test_two_points_give_their_distance(subtests: pytest.Subtests, tmp_path: Path) -> None:
    for case, (lines, cells, fields, expected) in TRACKS.items():
        with subtests.test(case):
            log = read(tmp_path, "track.csv", track_text(lines, cells), **TO_TAIL | fields)
            assert log.time_s == pytest.approx(0.04 * np.arange(10))
            assert log.values["head"] == pytest.approx(1e-3 * expected, nan_ok=True)


def test_a_first_frame_without_points_keeps_the_clock(tmp_path: Path) -> None:
    text = track_text(("scorer" + ",net" * 6, BODY_PARTS, COORDS), (FRAME, HEAD, SURE, TAIL, SURE))
    log = read(tmp_path, "track.csv", text.replace("\n0,300,250,0.99,509,262.5,0.99\n", "\n0,,,,,,\n"), **TO_TAIL | PX)
    assert log.values["head"] == pytest.approx(1e-3 * np.where(np.arange(10) == 0, np.nan, DISTANCE), nan_ok=True)


def sleap(path: Path, *, turned: bool) -> None:
    places = np.stack([[HEAD.T, TAIL.T], [TAIL.T, TAIL.T]]).transpose(0, 2, 1, 3)
    with h5py.File(path, "w") as file:
        file["tracks"] = places.transpose(3, 0, 2, 1) if turned else places
        scores = np.stack([[UNSURE[:, 0], SURE[:, 0]]] * 2)
        file["point_scores"] = scores.transpose(2, 0, 1) if turned else scores
        file["node_names"], file["track_names"] = [b"head", b"tail"], [b"worm1", b"worm2"]


def movement(path: Path) -> None:
    position = np.stack([[HEAD.T, TAIL.T], [TAIL.T, TAIL.T]]).transpose(3, 2, 1, 0)
    confidence = np.broadcast_to(UNSURE[:, None], (10, 2, 2))
    dims = ("time", "space", "keypoints", "individuals")
    coords = {"time": 0.04 * np.arange(10), "space": ["x", "y"], "keypoints": ["head", "tail"]}
    data = xarray.Dataset(
        {"position": (dims, position), "confidence": (("time", "keypoints", "individuals"), confidence)},
        coords | {"individuals": ["worm1", "worm2"]},
    )
    data.to_netcdf(path, engine="h5netcdf")


def test_files_of_trackers_give_the_distance_of_one_worm(tmp_path: Path) -> None:
    sleap(tmp_path / "a.h5", turned=False)
    sleap(tmp_path / "b.h5", turned=True)
    movement(tmp_path / "c.nc")
    for path in tmp_path.iterdir():
        log = read_measured(path, LogMap.model_validate(TO_TAIL | PX | {"individual": "worm1"}))
        assert log.values["head"] == pytest.approx(1e-3 * GAP, nan_ok=True)
        with pytest.raises(UnreadableText, match=r'individuals .*worm1.*: write individual = "worm1"'):
            read_measured(path, LogMap.model_validate(TO_TAIL | PX))


def test_the_points_of_wcon_are_read(tmp_path: Path) -> None:
    points = np.stack([HEAD, TAIL])
    record = {"id": "1", "t": (0.04 * np.arange(10)).tolist(), "ox": 1.0} | {
        axis: points[..., i].T.tolist() for i, axis in enumerate("xy")
    }
    units = {"t": "s", "x": "mm", "y": "mm"}
    column = {"signal": "ring_distance[1]", "distance_to": "point_2"}
    log = read(tmp_path, "w.wcon", json.dumps({"units": units, "data": record}), time="t", map={"point_1": column})
    assert log.values["point_1"] == pytest.approx(1e-3 * DISTANCE)


REFUSED: dict[str, tuple[str, str]] = {
    "no header": (rows(), "has no header: write the names"),
    "a name too few": ("t_ms,s1_mm\n" + rows().replace("\n", ",7\n"), "row 1 of .* 3 cells, its header 2 names"),
    "a name too many": ("t_ms,s1_mm,s2_mm\n" + rows(), "has 3 names, its rows have 2 cells"),
    "row names of R": ("t_ms,s1_mm\n" + "".join(f'"{n}",{row}\n' for n, row in enumerate(rows().split())), "row 1 of"),
    "thousands or decimals": ('t_ms,s1_mm\n' + '0,"1,250"\n' * 9, "may be a decimal comma or thousands"),
    "day or month": ("t_ms,s1_mm\n" + "".join(f"0{n}/05/2024 10:00:00,{n}\n" for n in range(1, 9)), "day or month"),
    "a mixed decimal sign": ("t_ms;s1_mm\n" + rows(";", ",") + "1400;0.12\n", "'0.12'"),
    "one frame far away": (
        track_text(TRACKS["SLEAP"][0], TRACKS["SLEAP"][1]).replace("\n0,9,", "\n0,999999999999,"), "MB, more than 300"
    ),
}  # fmt: skip


def test_what_would_be_read_wrong_is_refused(subtests: pytest.Subtests, tmp_path: Path) -> None:
    for case, (content, words) in REFUSED.items():
        with subtests.test(case), pytest.raises(UnreadableText, match=words) as refused:
            read(tmp_path, "log.csv", content, **MAP)
        assert "\n" not in str(refused.value)
    savemat(tmp_path / "matrix.mat", {"data": np.ones((10, 3))})
    with pytest.raises(UnreadableText, match=r"'data' is a matrix without names: .* t = data\(:, 1\)"):
        read_measured(tmp_path / "matrix.mat", LogMap.model_validate(MAP))


def test_a_damaged_file_is_refused_in_a_sentence(subtests: pytest.Subtests, tmp_path: Path) -> None:
    log_map = LogMap.model_validate(MAP)
    for content in (b"", b"\x00\xff\xfe garbage \x80", b"MATLAB 7.3"):
        for name in ("log.csv", "log.parquet", "log.mat", "log.nc", "log.h5", "log.wcon", "log.csv.gz"):
            (tmp_path / name).write_bytes(content)
            with subtests.test(f"{content!r:.60}, {name!r:.60}"), pytest.raises(AnnelidError):
                read_measured(tmp_path / name, log_map)
    with pytest.raises(UnreadableText, match="no such file"):
        read_measured(tmp_path / "none.csv", log_map)


def test_a_small_file_that_holds_terabytes_is_refused_before_it_is_read(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file.create_dataset("tracks", shape=(1, 2, 1000, 10**9), dtype="f8", chunks=(1, 2, 10, 1000))
        file["node_names"] = [b"head"]
    assert (tmp_path / "log.h5").stat().st_size < 100_000
    with pytest.raises(UnreadableText, match="MB, more than 300"):
        read_measured(tmp_path / "log.h5", LogMap.model_validate(MAP))


def elsewhere_by_link(file: h5py.File, secret: Path) -> None:
    file["group/t_ms"] = h5py.ExternalLink(str(secret), "numbers")


def elsewhere_by_storage(file: h5py.File, secret: Path) -> None:
    file.create_dataset("t_ms", shape=(8,), dtype="u1", external=[(str(secret), 0, 8)])


def elsewhere_by_layout(file: h5py.File, secret: Path) -> None:
    layout = h5py.VirtualLayout(shape=(8,), dtype="f8")
    layout[:] = h5py.VirtualSource(str(secret), "numbers", shape=(8,))
    file.create_virtual_dataset("t_ms", layout)


@pytest.mark.parametrize("point", [elsewhere_by_link, elsewhere_by_storage, elsewhere_by_layout])
def test_a_file_that_points_to_others_is_refused(point: Callable[[h5py.File, Path], None], tmp_path: Path) -> None:
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["numbers"] = np.arange(8.0)
    with h5py.File(tmp_path / "log.nc", "w") as file:
        point(file, tmp_path / "secret.h5")
    with pytest.raises(UnreadableText, match="elsewhere"):
        read_measured(tmp_path / "log.nc", LogMap.model_validate(MAP))
