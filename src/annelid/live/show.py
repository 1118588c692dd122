"""A view while it is open: the one loop in which the worm runs, the scene is drawn and requests of the page are met."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Mapping
from time import perf_counter
from typing import TYPE_CHECKING, Self

import numpy as np

from annelid.config import RunConfig
from annelid.errors import AnnelidError
from annelid.live.history import Moment
from annelid.live.lines_and_arrows import hit_point
from annelid.live.panel import Panel, Plot, legend_html, status_html
from annelid.live.player import player_of
from annelid.live.requests import Requests
from annelid.live.scene_nodes import Stage
from annelid.live.server import LOOPBACK, Server
from annelid.simulation.runfile import Run

if TYPE_CHECKING:
    import viser


FRAMES_A_SECOND = 30.0  # at most; fewer where a step of the body takes longer
LONGEST_TICK_S = 0.25  # a computer that was asleep does not make the view leap
PANEL_INTERVAL_S = 0.33  # between two updates of plots, time and status
PACE_OVER_S = 2.0  # over which the speed that is reached is measured


class Show:
    """A server with the scene and the panel of one worm, and the loop that keeps them going.

    Attributes:
        player: What is shown when.
        stage: Where it is seen.
        panel: What is beside the scene.
        requests: What the loop is to do.
        address: Of the page, with the token that it opens with.
        frames_drawn: Number of pictures sent so far.
    """

    def __init__(
        self,
        source: RunConfig | Run,
        *,
        host: str = LOOPBACK,
        port: int = 0,
        speed: float = 1.0,
        plots: Mapping[str, Plot] | None = None,
    ) -> None:
        """Builds the worm, or reads the run, and begins to serve.

        Args:
            source: A configuration to run, or a run to play.
            host: Address to listen on.
            port: Port, 0 for any that is free.
            speed: Simulated seconds per second.
            plots: Further plots beside the worm, by their names.

        Raises:
            ConfigError: The body cannot be viewed, or not be built.
            RunFileError: The run holds no postures.
        """
        config = source.config if isinstance(source, Run) else source
        self.player, painter = player_of(source, speed)
        self.requests = Requests()
        self._ending = threading.Event()
        self._pace: deque[tuple[float, float]] = deque()
        self._name = config.name
        self._drawn: tuple[Moment, bool] | None = None
        self.frames_drawn = 0
        self._server = Server(host, port)
        self.address = self._server.address
        self.stage = Stage(self._server, config, painter, self.player.moment)
        legend = legend_html(painter.arrow_N, painter.radius_m, painter.colored)
        self.panel = Panel(
            self._server, self.requests, self.player, self.stage, config, painter.weight_N, legend, plots or {}
        )
        if self.player.worm is not None and painter.weight_N is not None:
            self._server.scene.on_click()(
                lambda event: self.requests.add(self.poke, event.ray_origin, event.ray_direction)
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._server.stop()

    def run(self) -> None:
        """Keeps the view going until `end` is called."""
        last = panel_due = perf_counter()
        while not self._ending.is_set():
            begun = perf_counter()
            self.requests.meet()
            self.player.tick(min(begun - last, LONGEST_TICK_S), deadline=begun + 1.0 / FRAMES_A_SECOND)
            last = begun
            self._draw()
            if begun >= panel_due:
                self.panel.update(self._status(begun))
                panel_due = begun + PANEL_INTERVAL_S
            self._ending.wait(max(0.0, begun + 1.0 / FRAMES_A_SECOND - perf_counter()))

    def clients(self) -> list[viser.ClientHandle]:
        """Returns the browsers that look on, each with its camera."""
        return list(self._server.get_clients().values())

    def end(self) -> None:
        """Lets `run` return; may be called from any thread."""
        self._ending.set()

    def poke(self, origin_m: tuple[float, ...], direction: tuple[float, ...]) -> None:
        """Pokes what a line of sight hits, in the page's axes, m; raises `AnnelidError` in the past."""
        worm = self.player.worm
        if worm is None or self.player.stopped:
            return
        if not self.player.at_end:
            raise AnnelidError("This is the past: press Live and poke the worm again.")
        origin, sight = self.stage.to_model(np.asarray(origin_m), np.asarray(direction))
        place = hit_point(self.stage.picture.strands.reshape(-1, 3).astype(float), origin, sight)
        if place is not None:
            worm.poke(place, self.panel.poke_N * sight)

    def _draw(self) -> None:
        wanted = self.player.moment, self.stage.follow
        if wanted == self._drawn:
            return
        self._drawn = wanted
        with self._server.atomic():
            self.stage.show(self.player.moment)
        self._server.flush()
        self.frames_drawn += 1

    def _status(self, now: float) -> str:
        player, time_s = self.player, self.player.moment.time_s
        self._pace.append((now, time_s))
        while now - self._pace[0][0] > PACE_OVER_S:
            self._pace.popleft()
        passed = now - self._pace[0][0]
        pace = (time_s - self._pace[0][1]) / passed if passed > 0 else 0.0
        parts, below = [f"{time_s:.2f} s"], self.requests.notice
        if player.stopped:
            below = f"Stopped: {player.stopped}. Move the sliders back and press Restart. {below}"
        elif not player.playing:
            parts.append("paused")
        else:
            parts.append(f"{max(pace, 0.0):.2f} \N{MULTIPLICATION SIGN} real time")
            parts += [] if player.worm is None or player.at_end else ["(the past)"]
        return status_html(self._name, parts, below)
