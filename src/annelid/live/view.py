"""A worm that is looked at, and what its user requests."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from annelid.config import Knob, RunConfig
from annelid.errors import AnnelidError
from annelid.live.player import Player
from annelid.live.stage import Stage


class View:
    """A worm, the scene in which it is seen, and what is requested of both.

    All that changes the worm, the player or the scene is done by one loop; other threads `request` it.

    Attributes:
        config: What the worm is run under, or was.
        player: What is shown when.
        stage: Where it is seen.
        follow: Whether the worm is kept in the middle, or may crawl away.
        notice: A sentence for the user, or an empty one.
    """

    def __init__(self, config: RunConfig, player: Player, stage: Stage) -> None:
        self.config = config
        self.player = player
        self.stage = stage
        self.follow = True
        self.notice = ""
        self._requests: dict[tuple[Any, ...], tuple[Callable[..., None], tuple[Any, ...]]] = {}
        self._lock = threading.Lock()

    def request(self, call: Callable[..., None], *arguments: Any) -> None:
        """Has the loop call something; may be called from any thread.

        Of calls that differ in their last argument only, as while a slider is dragged, the last one counts.
        """
        with self._lock:
            self._requests[call.__name__, *arguments[:-1]] = call, arguments

    def restart(self) -> None:
        """Begins anew, with the sliders as they are."""
        self.notice = ""
        self.player.restart()

    def set_knob(self, knob: Knob, shown: float) -> None:
        """Changes a field of the running worm to what a slider shows."""
        assert self.player.worm is not None
        self.notice = ""
        self.player.worm.adjust({knob.field: knob.value(shown)})

    def reset_knobs(self) -> None:
        """Gives every field that was changed its first value."""
        assert self.player.worm is not None
        self.notice = ""
        self.player.worm.reset_fields()

    def meet_requests(self) -> None:
        """Makes the calls that were requested; the sentence of one that fails becomes the notice."""
        with self._lock:
            requests, self._requests = self._requests, {}
        for call, arguments in requests.values():
            try:
                call(*arguments)
            except AnnelidError as error:
                self.notice = str(error)
