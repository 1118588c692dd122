"""A run file from a stranger: nothing outside of it is opened, and it takes no more memory than it has bytes."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

from annelid.cli import app
from annelid.config import load_config
from annelid.errors import RunFileError
from annelid.simulation import Run, open_run, simulate
from annelid.simulation.runfile import read_checkpoint, read_config

SECRET = b"the secret of another file " * 4096
Change = Callable[[h5py.File], object]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("stranger")
    return simulate(load_config("riddle2022-planar", {"duration_s": 0.05}), folder / "run", progress=False)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "secret").write_bytes(SECRET)
    with h5py.File(tmp_path / "other.nc", "w") as other:
        other["numbers"] = np.frombuffer(SECRET[:800])
    return tmp_path


def changed(run: Run, target: Path, change: Change) -> Path:
    """Copies a run, changes it, and lets it pass for one of an older annelid, whose files carry no digest."""
    shutil.copy(run.path, target)
    with h5py.File(target, "r+") as file:
        file.attrs.pop("schema_version", None)
        change(file)
    return target


def of_other_bytes(file: h5py.File) -> None:
    shape = file["activation"].shape  # type: ignore[union-attr]
    del file["activation"]
    size = 8 * int(np.prod(shape))
    made = file.create_dataset("activation", shape, "<f8", external=[(b"secret", 0, size)])
    for dim, name in enumerate(("time", "muscle")):
        made.dims[dim].attach_scale(file[name])


def of_another_file(file: h5py.File) -> None:
    layout = h5py.VirtualLayout((100,), "<f8")
    layout[:] = h5py.VirtualSource("other.nc", "numbers", (100,))
    file.create_virtual_dataset("activation_too", layout)


def with_unknown_filter(file: h5py.File) -> None:
    made = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    made.set_chunk((100,))
    made.set_filter(32015, h5py.h5z.FLAG_OPTIONAL, (1,))
    h5py.h5d.create(file.id, b"packed", h5py.h5t.IEEE_F64LE, h5py.h5s.create_simple((100,)), made)


def with_one_long_text_many_times(file: h5py.File) -> None:
    texts = file.create_dataset("texts", (1000,), h5py.string_dtype())
    texts[0] = "x" * 20_000
    where = texts.id.get_offset()
    name = file.filename
    file.close()
    content = bytearray(Path(name).read_bytes())
    pointer = bytes(content[where : where + 16])
    content[where : where + 16_000] = 1000 * pointer
    Path(name).write_bytes(content)


def with_many_references(file: h5py.File) -> None:
    scales = file["activation"].attrs["DIMENSION_LIST"]
    many = np.empty(2, dtype=object)
    many[0], many[1] = scales[0], np.array([file["muscle"].ref] * 5000, dtype=h5py.ref_dtype)  # type: ignore[index]
    del file["activation"].attrs["DIMENSION_LIST"]
    file["activation"].attrs.create("DIMENSION_LIST", many, dtype=h5py.vlen_dtype(h5py.ref_dtype))


ATTACKS: dict[str, Change] = {
    "external storage": of_other_bytes,
    "virtual dataset": of_another_file,
    "external link": lambda file: file.__setitem__("stolen", h5py.ExternalLink("other.nc", "/numbers")),
    "external link in a group": lambda file: file["checkpoint"].__setitem__("more", h5py.ExternalLink("other.nc", "/")),  # type: ignore[union-attr]
    "soft link": lambda file: file.__setitem__("again", h5py.SoftLink("/activation")),
    "unknown filter": with_unknown_filter,
    "compressed zeros": lambda file: file.create_dataset("zeros", (1000, 1000), "<f8", compression="gzip"),
    "numbers that are not there": lambda file: file.create_dataset("zeros", (25_000_000,), "<f8"),
    "more elements than memory": lambda file: file.create_dataset("zeros", (10**15, 1000), "<f8"),
    "one long text many times": with_one_long_text_many_times,
    "many references to a dimension": with_many_references,
    "references of the file": lambda file: file.attrs.create(
        "DIMENSION_LIST", np.array([file.ref], dtype=h5py.ref_dtype)
    ),
    "more dimensions than a run has": lambda file: file.create_dataset("deep", (1,) * 9, data=np.zeros((1,) * 9)),
    "references": lambda file: file.create_dataset("to", data=file["time"].ref, dtype=h5py.ref_dtype),
    "a group in itself": lambda file: file["checkpoint"].__setitem__("self", file["checkpoint"]),  # type: ignore[union-attr]
    "the same numbers many times": lambda file: [
        file.__setitem__(f"t{i}", file["checkpoint/slot_0"]) for i in range(20)
    ],
    "lists of lists": lambda file: file.create_dataset("lists", (3,), h5py.vlen_dtype("<f8")),
    "a named type": lambda file: file.__setitem__("kind", np.dtype([("a", "<f8")])),
    "an attribute of references": lambda file: file.attrs.__setitem__("to", file.ref),
    "many long attributes": lambda file: [file.attrs.__setitem__(f"a{i}", i) for i in range(1000)],
}


def test_what_no_run_file_holds_is_refused_before_it_is_read(subtests: pytest.Subtests, run: Run, folder: Path) -> None:
    for attack in ATTACKS:
        with subtests.test(f"{attack!r:.60}"):
            path = changed(run, folder / "run.nc", ATTACKS[attack])
            for read in (open_run, read_config, read_checkpoint):
                with pytest.raises(RunFileError) as caught:
                    read(path)
                assert "\n" not in str(caught.value)


def in_attributes(file: h5py.File) -> None:
    for i in range(100):
        file["samples_written"].attrs[f"a{i}"] = f"{i:077}"


def in_lists(file: h5py.File) -> None:
    for name in BOOKKEEPING:
        texts = np.array([f"{name:_>40}{i:037}" for i in range(60)], dtype=object)
        file[name].attrs.create("texts", texts, dtype=h5py.string_dtype())


BOOKKEEPING = ("samples_written", "frames_written", "status_code", "status_message")


@pytest.mark.parametrize(
    ("write", "says"),
    [
        (in_attributes, "are longer than the file"),
        (in_lists, "not one text"),
    ],
)
def test_many_texts_that_are_one_long_text_are_not_read(run: Run, folder: Path, write: Change, says: str) -> None:
    path = folder / "run.nc"
    # Of the oldest form, which has no checksums of its own.
    with h5py.File(run.path) as whole, h5py.File(path, "w", libver="earliest") as file:
        file.attrs.update({"config": whole.attrs["config"], "annelid_version": "0"})
        for name in BOOKKEEPING:
            file[name] = 0
        long = file.create_dataset("long", (), h5py.string_dtype())
        long[()] = "x" * 100_000
        write(file)
        where = long.id.get_offset()
    content = path.read_bytes()
    pointer = content[where : where + 16]
    # A text is its length, the address of a heap and its number there.
    content, count = re.subn(rb"\x4d\0\0\0.{4}\0{4}.{2}\0\0", lambda _: pointer, content, flags=re.DOTALL)
    assert count >= 100
    path.write_bytes(content)
    for read in (open_run, read_config, read_checkpoint):
        with pytest.raises(RunFileError, match=says):
            read(path)


def test_an_older_file_opens_as_before(run: Run, folder: Path) -> None:
    path = changed(run, folder / "run.nc", lambda file: None)
    assert open_run(path).data.identical(run.data.drop_attrs(deep=False).assign_attrs(open_run(path).data.attrs))
    assert read_config(path) == run.config
    assert read_checkpoint(path).step == 50


def test_a_pipe_is_not_waited_for(folder: Path) -> None:
    os.mkfifo(folder / "run.nc")
    with pytest.raises(RunFileError, match="it is not a file"):
        open_run(folder)


def test_odd_attributes_end_in_a_sentence(run: Run, folder: Path) -> None:
    for number, value in enumerate((5, np.arange(4.0), "\x1b[2J{", h5py.Empty("f"), np.nan, "[" * 5000, "1" * 5000)):
        for name in ("config", "annelid_version", "created"):
            path = changed(run, folder / f"{number}.nc", lambda file, odd={name: value}: file.attrs.update(odd))
            done = CliRunner().invoke(app, ["show", str(path), "--json"])
            assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
            assert done.exit_code in (0, 2), done.output
            assert done.exit_code == 0 or len(done.stderr.splitlines()) == 1
