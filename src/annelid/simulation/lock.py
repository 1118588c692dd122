"""One writer per folder: a lock of the operating system's, which ends with the process that holds it.

The lock is on a file in the folder, in which the holder says who it is. The file goes when the lock ends; one that a
killed process leaves behind locks nothing.
"""

from __future__ import annotations

import errno
import os
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import wraps
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, ParamSpec, TypeVar

from annelid.errors import ConfigError, RunFileError

if TYPE_CHECKING:
    from filelock import BaseFileLock

LOCK_NAME = ".annelid.lock"

_ATTEMPTS = 100
_WITHOUT_LOCKS = frozenset({errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP})

_P = ParamSpec("_P")
_R = TypeVar("_R")


@contextmanager
def locked(folder: str | Path, *, new: bool = False) -> Iterator[Path]:
    """Keeps every other writer out of a folder, which is made if it is not there; yields it.

    The same thread may lock again. Folders that were made for the lock and are empty at its end are removed. A new
    folder is to be made, and no other.

    Raises:
        ConfigError: It is a file.
        FileExistsError: It is there and should be new.
        RunFileError: Another process or thread writes there, or it cannot be made or written.
    """
    folder, file = Path(folder), Path(folder).resolve() / LOCK_NAME
    lock = _lock_of(file)
    if lock.is_locked:
        yield folder
        return
    made = [each for each in (folder, *folder.parents) if not each.exists()]
    try:
        _take(lock, folder, new)
    except FileExistsError:
        # Another made it since, and it may still be empty.
        raise
    except BaseException:
        _remove_empty(made)
        raise
    own = file.stat() if lock.is_locked else None
    try:
        yield folder
    finally:
        with suppress(OSError):
            # While it is locked, and only if it is the same file, so that nobody else's is removed.
            if own is not None and os.path.samestat(own, file.stat()):
                file.unlink()
        lock.release()
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


def _lock_of(file: Path) -> BaseFileLock:
    """Returns the lock on a file, the same one for every call, with a state for each thread."""
    from filelock import FileLock

    return FileLock(file, timeout=0, is_singleton=True, fallback_to_soft=False, on_acquired=_write_holder)


def _take(lock: BaseFileLock, folder: Path, new: bool) -> None:
    """Makes a folder and locks it."""
    from filelock import Timeout

    try:
        for _ in range(_ATTEMPTS):
            # Whoever ends a lock removes the folder if it is empty.
            with suppress(FileNotFoundError):
                try:
                    folder.mkdir(parents=True, exist_ok=not new)
                except FileExistsError:
                    if new or folder.is_file():
                        raise
                    continue
                lock.acquire()
                return
        raise RunFileError(f"cannot write into the folder {folder}: it cannot be made")
    except Timeout:
        if new:
            raise FileExistsError(folder) from None
        holder = _holder(Path(lock.lock_file))
        raise RunFileError(f"{holder} writes into the folder {folder}: name another, or wait for its end") from None
    except FileExistsError:
        if new:
            raise
        raise ConfigError(f"{folder} is a file: name a folder") from None
    except OSError as error:
        if error.errno not in _WITHOUT_LOCKS:
            raise RunFileError(f"cannot write into the folder {folder}: {error.strerror}") from None
        warnings.warn(
            f"{folder} is on a file system without locks ({error.strerror}): let no other process write there",
            stacklevel=2,
        )


def _write_holder(descriptor: int) -> None:
    os.ftruncate(descriptor, 0)
    # Windows keeps others from reading the first byte of a locked file.
    os.write(descriptor, f" {os.getpid()}".encode())


def _holder(file: Path) -> str:
    """Says who holds a lock, as far as its file, which may be anybody's, tells."""
    try:
        with file.open("rb") as content:
            content.seek(1)
            return f"process {int(content.read(20))}"
    except (OSError, ValueError):
        return "another process"


def _remove_empty(folders: list[Path]) -> None:
    with suppress(OSError):
        for folder in folders:
            folder.rmdir()
