"""Runs the command line: the command ``annelid`` and ``python -m annelid``."""

from __future__ import annotations

# Only what Python has loaded anyway.
import gc
import signal


def main() -> None:
    """Loads the command line and runs it; an interruption while it loads ends it at once, without a traceback."""
    # Where interruptions are ignored, as under nohup, they stay so.
    heeded = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if heeded:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    # A run loads 140,000 objects, which all stay: to look for garbage among them takes a tenth of the loading.
    gc.set_threshold(200_000)
    from annelid.cli import main as run

    if heeded:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    run()


if __name__ == "__main__":
    main()
