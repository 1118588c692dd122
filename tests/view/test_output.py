from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from annelid.errors import RunFileError
from annelid.output import whole_file, with_suffix


def test_a_file_appears_whole_and_alone(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    target.write_text("before")
    with whole_file(target) as draft:
        draft.write_text("after")
        assert target.read_text() == "before"
        assert draft.suffix == ".txt"
        assert draft.name.startswith(".")
    assert target.read_text() == "after"
    assert list(tmp_path.iterdir()) == [target]


def write_half(target: Path) -> None:
    with whole_file(target) as draft:
        draft.write_text("half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(draft))


def test_a_failure_keeps_the_old_file_and_leaves_no_draft(tmp_path: Path) -> None:
    (target := tmp_path / "a.txt").write_text("before")
    with pytest.raises(RunFileError, match=r"cannot write .*a\.txt: No space left on device$"):
        write_half(target)
    assert target.read_text() == "before"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on Windows")
def test_a_pipe_is_written_and_not_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    with whole_file(pipe) as draft:
        draft.write_text("through")
    assert os.read(reader, 100) == b"through"
    os.close(reader)
    assert pipe.is_fifo()


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (link := tmp_path / "link.txt").symlink_to(target := tmp_path / "a.txt")
    target.write_text("before")
    with whole_file(link) as draft:
        draft.write_text("after")
    assert link.is_symlink()
    assert target.read_text() == "after"


def test_suffixes_are_checked_and_added(tmp_path: Path) -> None:
    allowed = (".png", ".pdf")
    assert with_suffix("a", allowed, "a figure", default=".png") == Path("a.png")
    assert with_suffix("a.PDF", allowed, "a figure") == Path("a.PDF")
    with pytest.raises(RunFileError, match=r"a\.xyz cannot be written as a figure: .* \.png, \.pdf"):
        with_suffix("a.xyz", allowed, "a figure", default=".png")
    with pytest.raises(RunFileError, match="must end in"):
        with_suffix("a", allowed, "a figure")
    with pytest.raises(RunFileError, match="is a folder"):
        with_suffix(tmp_path, allowed, "a figure", default=".png")
