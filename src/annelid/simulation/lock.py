"""One writer per folder: a lock of the operating system's, which ends with the process that holds it.

The lock is on a file in the folder, in which the holder says who it is. The file goes when the lock ends; one that a
killed process leaves behind locks nothing.
"""

from __future__ import annotations

import json
import os
import shlex
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from functools import wraps
from inspect import signature
from pathlib import Path
from typing import ParamSpec, TypeVar

from annelid.errors import ConfigError, RunFileError, shortened

LOCK_NAME = ".annelid.lock"

_FLAGS = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0)
_HOLDER_BYTES = 4096
_ATTEMPTS = 100
# Windows keeps others from reading what is locked, so the lock lies beyond the text.
_LOCKED_BYTE = 1 << 30

_P = ParamSpec("_P")
_R = TypeVar("_R")

_held: set[tuple[int, int, Path]] = set()
"""Locks of this process, each with its process and thread: within one, the same thread may lock again."""


@contextmanager
def locked(folder: str | Path, *, new: bool = False) -> Iterator[Path]:
    """Keeps every other writer out of a folder, which is made if it is not there; yields it.

    Folders that were made for the lock and are empty at its end are removed. A new folder is to be made, and no other.

    Raises:
        ConfigError: It is a file.
        FileExistsError: It is there and should be new.
        RunFileError: Another process or thread writes there, or it cannot be made or written.
    """
    folder = Path(folder)
    lock = os.getpid(), threading.get_ident(), folder.resolve()
    if lock in _held:
        yield folder
        return
    made = [each for each in (folder, *folder.parents) if not each.exists()]
    try:
        descriptor = _take(folder, new)
    except FileExistsError:
        # Another made it since, and it may still be empty.
        raise
    except BaseException:
        _remove_empty(made)
        raise
    _held.add(lock)
    try:
        yield folder
    finally:
        _held.discard(lock)
        _release(folder / LOCK_NAME, descriptor)
        _remove_empty(made)


def locks(parameter: str) -> Callable[[Callable[_P, _R]], Callable[_P, _R]]:
    """Has a function lock the folder that one of its parameters names, as `locked` does, for as long as it runs."""

    def decorated(function: Callable[_P, _R]) -> Callable[_P, _R]:
        form = signature(function)

        @wraps(function)
        def locking(*args: _P.args, **kwargs: _P.kwargs) -> _R:
            given = form.bind(*args, **kwargs)
            given.apply_defaults()
            with locked(given.arguments[parameter]):
                return function(*args, **kwargs)

        return locking

    return decorated


def _take(folder: Path, new: bool) -> int:
    """Makes a folder and locks it; returns the descriptor of its lock file."""
    try:
        problem = "it cannot be made"
        for _ in range(_ATTEMPTS):
            # Whoever ends a lock removes the lock file, and the folder if it is empty.
            with suppress(FileNotFoundError):
                try:
                    folder.mkdir(parents=True, exist_ok=not new)
                except FileExistsError:
                    if new or folder.is_file():
                        raise
                    continue
                problem = "it comes and goes"
                descriptor = os.open(folder / LOCK_NAME, _FLAGS, 0o666)
                try:
                    if not _lock(descriptor, folder):
                        if new:
                            raise FileExistsError(folder)
                        raise RunFileError(_taken(folder, os.read(descriptor, _HOLDER_BYTES)))
                    if os.path.samestat(os.fstat(descriptor), os.stat(folder / LOCK_NAME)):
                        os.ftruncate(descriptor, 0)
                        os.write(descriptor, _holder())
                        return descriptor
                except BaseException:
                    os.close(descriptor)
                    raise
                os.close(descriptor)
        raise RunFileError(f"cannot write into the folder {folder}: {problem}")
    except FileExistsError:
        if new:
            raise
        raise ConfigError(f"{folder} is a file: name a folder") from None
    except OSError as error:
        raise RunFileError(f"cannot write into the folder {folder}: {error.strerror}") from None


if sys.platform == "win32":
    import msvcrt

    def _lock(descriptor: int, folder: Path) -> bool:
        """Takes the lock; false where another has it."""
        os.lseek(descriptor, _LOCKED_BYTE, os.SEEK_SET)
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        finally:
            os.lseek(descriptor, 0, os.SEEK_SET)
        return True

    def _release(lock: Path, descriptor: int) -> None:
        """Lets go of the lock, and removes its file, which Windows allows for a closed one only."""
        os.close(descriptor)
        with suppress(OSError):
            lock.unlink()

else:
    import fcntl

    def _lock(descriptor: int, folder: Path) -> bool:
        """Takes the lock; false where another has it."""
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError as error:
            warnings.warn(
                f"{folder} is on a file system without locks ({error.strerror}): let no other process write there",
                stacklevel=2,
            )
        return True

    def _release(lock: Path, descriptor: int) -> None:
        """Removes the lock file while it is locked, so that no one else's is removed, and lets go of it."""
        with suppress(OSError):
            if os.path.samestat(os.fstat(descriptor), os.stat(lock)):
                lock.unlink()
        os.close(descriptor)


def _holder() -> bytes:
    program = Path(sys.argv[0]).name or "python"
    since = datetime.now().astimezone().isoformat(sep=" ", timespec="seconds")
    command = shlex.join([program, *sys.argv[1:]])[: _HOLDER_BYTES // 8]
    return json.dumps({"pid": os.getpid(), "since": since, "command": command}).encode()


def _taken(folder: Path, holder: bytes) -> str:
    try:
        said = json.loads(holder)
        # The file may be anybody's, and the sentence is one line.
        since, command = (shortened(ascii(str(said[key]))[1:-1]) for key in ("since", "command"))
        who = f"process {shortened(str(int(said['pid'])))} (since {since}: {command})"
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
        who = "another process"
    return f"{who} writes into the folder {folder}: name another, or wait for its end"


def _remove_empty(folders: list[Path]) -> None:
    with suppress(OSError):
        for folder in folders:
            folder.rmdir()
