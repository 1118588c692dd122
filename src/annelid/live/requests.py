"""What the user of a view requests, to be done by the one loop that changes the worm, the player and the scene."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from annelid.errors import AnnelidError


class Requests:
    """Calls that are requested from any thread.

    Attributes:
        notice: The sentence in which one of the calls that were last made failed, or an empty one.
    """

    def __init__(self) -> None:
        self.notice = ""
        self._calls: dict[tuple[Any, ...], tuple[Callable[..., None], tuple[Any, ...]]] = {}
        self._lock = threading.Lock()

    def add(self, call: Callable[..., None], *arguments: Any) -> None:
        """Requests a call; of those that differ in their last argument only, as of a slider, the last one counts."""
        with self._lock:
            self._calls[call.__name__, *arguments[:-1]] = call, arguments

    def meet(self) -> None:
        """Makes the calls."""
        with self._lock:
            calls, self._calls = self._calls, {}
        if calls:
            self.notice = ""
        for call, arguments in calls.values():
            try:
                call(*arguments)
            except AnnelidError as error:
                self.notice = str(error)
