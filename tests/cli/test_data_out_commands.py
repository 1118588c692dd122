"""The commands `export`, `compare` and `cite`, as typed."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from annelid.simulation.runfile import open_run
from outcome import Command


@pytest.fixture
def run(finished: Path, tmp_path: Path) -> Path:
    """A copy of the run, to be written into."""
    return shutil.copytree(finished, tmp_path / "run")


def test_an_export_goes_into_the_run_and_may_be_repeated(annelid: Command, run: Path) -> None:
    annelid("export", run, "--to", "csv")
    done = annelid("export", run, "--to", "csv")
    assert done.exit_code == 0, done.err
    assert str(run / "csv" / "time_muscle.csv") in done.out.split()
    assert all(Path(line).exists() for line in done.out.split())


def test_signals_times_and_thinning_reach_the_file(annelid: Command, run: Path) -> None:
    window = ("--from-time", "0.2", "--to-time", "0.4", "--every", "10")
    done = annelid("export", run, "--to", "csv", "--signals", "ring_length", *window, "-o", "rings.csv")
    assert done.out.split() == ["rings.csv"]
    rows = Path("rings.csv").read_text().splitlines()
    assert rows[0] == "time (s),muscle,ring_length (m)"
    assert [row.split(",")[0] for row in rows[1::3]] == ["0.2", "0.25", "0.3", "0.35000000000000003", "0.4"]


def test_named_files_are_not_replaced_without_force(annelid: Command, run: Path) -> None:
    Path("mine.mat").write_text("precious")
    assert "--force" in annelid("export", run, "--to", "mat", "-o", "mine.mat").sentence()
    assert Path("mine.mat").read_text() == "precious"
    assert annelid("export", run, "--to", "mat", "-o", "mine.mat", "--force").exit_code == 0
    Path("full").mkdir()
    Path("full/notes.txt").write_text("precious")
    assert "not empty" in annelid("export", run, "--to", "parquet", "-o", "full").sentence()
    assert [path.name for path in Path("full").iterdir()] == ["notes.txt"]


def test_what_does_not_go_together_is_refused(annelid: Command, run: Path) -> None:
    before = sorted(run.rglob("*"))
    for arguments, words in (
        (("--to", "xlsx"), "unknown format 'xlsx'"),
        (("--to", "gif"), "annelid draw RUN --video FILE.gif"),
        (("--to", "mp4"), "annelid draw RUN --video FILE.mp4"),
        (("--to", "html", "--every", "2"), "--every has no effect on html, which takes --from-time, --to-time"),
        (("--to", "mjcf", "--to-time", "1"), "--to-time has no effect on mjcf, which takes the whole run"),
        (("--to", "mat", "-o", "run.csv"), "must end in .mat"),
        (("--to", "mjcf"), "needs the 3D worm"),
        (("--to", "csv", "--signals", "rings"), "no signal 'rings'"),
    ):
        done = annelid("export", run, *arguments)
        assert done.exit_code == 2
        assert words in done.sentence()
    assert sorted(run.rglob("*")) == before


def test_compare_prints_a_table_and_draws_into_a_folder(annelid: Command, run: Path, finished: Path) -> None:
    done = annelid("compare", run, finished, "-o", "both")
    assert done.exit_code == 0, done.err
    assert "\norder " in done.out
    assert "the configurations are the same" in done.out
    assert sorted(path.name for path in Path("both").iterdir()) == ["comparison.json", "lengths.png"]
    assert "travel.png not drawn" in done.sentence()
    assert "--force" in annelid("compare", run, finished, "-o", "both").sentence()
    assert "at least two runs" in annelid("compare", run).err
    Path("network.toml").write_text("a = 1")
    assert "with --network of a network" in annelid("compare", run, "network.toml").sentence()


def test_compare_with_a_measured_log(annelid: Command, run: Path) -> None:
    data = open_run(run).data
    columns = {"t_s": data["time"].values + 7.0, "ring_mm": 1e3 * data["ring_length"].values[:, 0]}
    rows = zip(*columns.values(), strict=True)
    Path("log.csv").write_text("t_s,ring_mm\n" + "".join(f"{t},{length}\n" for t, length in rows))
    Path("map.toml").write_text(
        f'time = "t_s"\nlag_s = -7.0\n[map]\nring_mm = "ring_length[{data["muscle"].values[0]}]"\n'
    )
    done = annelid("compare", run, "log.csv", "--map", "map.toml", "-o", "robot")
    assert done.exit_code == 0, done.err
    assert done.out.split()[-2:] == ["robot/agreement.json", "robot/agreement.png"]
    proposed = annelid("compare", run, "log.csv")
    assert proposed.exit_code == 2
    assert "log.map.toml is a proposal" in proposed.sentence()
    assert annelid("compare", "--map-for", "log.csv").out == Path("log.map.toml").read_text()
    assert "there is log.map.toml" in annelid("compare", run, "log.csv").sentence()
    assert "takes a log alone" in annelid("compare", run, "--map-for", "log.csv").err
    read = json.loads(annelid("compare", run, "log.csv", "--map", "map.toml", "--json").out)
    assert read == json.loads(Path("robot/agreement.json").read_text())
    assert read["lag_s"] == pytest.approx(-7.0)
    assert read["signals"]["ring_mm"]["rms"] < 1e-4
    assert "--force" in annelid("compare", run, "log.csv", "--map", "map.toml", "-o", "robot").sentence()
    assert "name both" in annelid("compare", run, "--map", "map.toml").err


def test_cite_takes_a_run_a_preset_or_a_file(annelid: Command, run: Path) -> None:
    Path("mine.toml").write_text('extends = "riddle2022-planar"\n')
    for source in ("riddle2022-planar", run, "mine.toml"):
        done = annelid("cite", source)
        assert done.exit_code == 0, done.err
        assert "@misc{riddle2022," in done.out
        assert "todorov2012" not in done.out


def test_cite_says_what_it_cannot_find(annelid: Command) -> None:
    for source, words in (("wangg", "did you mean 'wang'"), (".", "holds no run.nc"), ("no.toml", "no.toml")):
        assert words in annelid("cite", source).sentence()
