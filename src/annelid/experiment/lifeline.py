"""A worker process ends with its parent, however that ends; a process may import this before it has loaded the rest."""

from __future__ import annotations

import _thread
import os
import signal
import threading
import time
from collections.abc import Callable

GRACE_S = 2.0
"""How long a run has to end in good order and to clear away its files, s."""


def end_after(wait: Callable[[], object]) -> None:
    """Has this process end once a call returns or fails, also in the middle of a run; initializer of a pool's process.

    Such a call waits for a pipe that only the parent keeps open. Ctrl-C and a terminal that closes reach every process
    of the terminal; here only the parent decides on them.
    """
    for name in ("SIGINT", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    threading.Thread(target=_end, args=(wait,), name="lifeline", daemon=True).start()


def _end(wait: Callable[[], object]) -> None:
    try:
        wait()
    finally:
        # Ends a run in good order (`simulation.progress`), and does nothing outside of one.
        _thread.interrupt_main(signal.SIGTERM)
        time.sleep(GRACE_S)
        os._exit(1)
