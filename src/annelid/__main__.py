"""Runs the command line: the command ``annelid`` and ``python -m annelid``."""

from __future__ import annotations

# Only what Python has loaded anyway: until `main` is called, an interruption ends in a traceback.
import gc
import os
import signal

TYPE_CHECKING = False
if TYPE_CHECKING:
    from types import FrameType


def main() -> None:
    """Loads the command line and runs it; an interruption while it loads ends it without a traceback."""
    # Where interruptions are ignored, as under nohup, they stay so.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupted)
    # A run loads 140,000 objects, which all stay: to look for garbage among them takes a tenth of the loading.
    gc.set_threshold(200_000)
    try:
        from annelid.cli import main as run

        run()
    except KeyboardInterrupt:
        _leave()


def _interrupted(number: int, frame: FrameType | None) -> None:
    """Raises KeyboardInterrupt, but for the middle of an import, which may lose it or turn it into another error."""
    outer = frame
    while outer is not None:
        if outer.f_code.co_filename.startswith("<frozen importlib"):
            _leave()
        outer = outer.f_back
    signal.default_int_handler(number, frame)


def _leave() -> None:
    os.write(2, b"annelid: interrupted\n")
    os._exit(130)


if __name__ == "__main__":
    main()
