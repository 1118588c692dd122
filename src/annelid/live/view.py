"""A worm that is looked at, and what its user asks for."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from annelid.config import Knob, RunConfig
from annelid.errors import AnnelidError
from annelid.live.player import Player
from annelid.live.stage import Stage


class View:
    """A worm, the scene in which it is seen, and what is asked of both.

    All that changes the worm, the player or the scene is done by one loop; other threads `ask` for it.

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
        self._wishes: dict[tuple[Any, ...], tuple[Callable[..., None], tuple[Any, ...]]] = {}
        self._wishing = threading.Lock()

    def ask(self, call: Callable[..., None], *arguments: Any) -> None:
        """Has the loop call something; may be called from any thread.

        Of calls that differ in their last argument only, as while a slider is dragged, the last one counts.
        """
        with self._wishing:
            self._wishes[call.__name__, *arguments[:-1]] = call, arguments

    def restart(self) -> None:
        """Begins anew, with the sliders as they are."""
        self.notice = ""
        self.player.restart()

    def turn(self, knob: Knob, shown: float) -> None:
        """Changes a field of the running worm to what a slider shows."""
        assert self.player.worm is not None
        self.notice = ""
        self.player.worm.adjust({knob.field: knob.value(shown)})

    def as_at_first(self) -> None:
        """Gives every field that was turned its first value."""
        assert self.player.worm is not None
        self.notice = ""
        self.player.worm.as_at_first()

    def meet_wishes(self) -> None:
        """Makes the calls that were asked for; the sentence of one that fails is noticed."""
        with self._wishing:
            wishes, self._wishes = self._wishes, {}
        for call, arguments in wishes.values():
            try:
                call(*arguments)
            except AnnelidError as error:
                self.notice = str(error)
