"""The workers of a Dask scheduler as an executor. Only here is Dask imported."""

from __future__ import annotations

import asyncio
import logging
import warnings
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

from annelid.errors import ClusterError, ConfigError, MissingDependency, shown
from annelid.textfiles import read_json

MISSING = "runs on a cluster need Dask: install it with  pip install 'annelid[sweep]'"
JOIN_S = 10.0
"""How long a scheduler may take to answer, s."""
_FORM = "must be tcp://HOST:PORT, tls://HOST:PORT, or the path of a scheduler file (.json)"


@contextmanager
def joined(where: str) -> Iterator[Executor]:
    """Gives the workers of a Dask scheduler that is running somewhere.

    Args:
        where: As the user gave it, since a scheduler runs code here: its address, or the path of the file that
            ``dask scheduler --scheduler-file`` writes.

    Raises:
        ConfigError: It is no such address or file.
        MissingDependency: Dask is not installed.
        ClusterError: No scheduler answers there.
    """
    address = _address(where)
    try:
        from distributed import Client
    except ImportError:
        raise MissingDependency(MISSING) from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        # In a thread, since this one may have a loop that runs, as in a notebook.
        with ThreadPoolExecutor(1) as thread:
            thread.submit(asyncio.run, _greet(address)).result()
        client = Client(address, timeout=JOIN_S)
    except (OSError, ValueError, TypeError) as error:
        raise ClusterError(f"no scheduler answers at {address}: start one with  dask scheduler") from error
    try:
        if not client.nthreads():
            warnings.warn(f"no workers yet: start them with  dask worker {where} --nthreads 1", stacklevel=2)
        yield client.get_executor(pure=False)
    finally:
        client.close(timeout=2)


def _address(where: str) -> str:
    address: object = where
    if where.endswith(".json"):
        content = read_json(Path(where), "the scheduler file")
        address = content.get("address") if isinstance(content, dict) else None
    if not (isinstance(address, str) and address.startswith(("tcp://", "tls://")) and address.isprintable()):
        named = "scheduler" if address is where else f"the scheduler file {where} has address"
        raise ConfigError(f"{named} = {shown(address)}: {_FORM}")
    return address


async def _greet(address: str) -> None:
    """Shakes hands with a scheduler: Dask's client would wait for ever for one that accepts and is silent."""
    from distributed import Security
    from distributed.comm.core import connect

    greeting = connect(address, timeout=JOIN_S, **Security().get_connection_args("client"))
    (await asyncio.wait_for(greeting, JOIN_S)).abort()
