"""What is shown when: a clock that plays, pauses, goes slower or faster, and back through what is remembered."""

from __future__ import annotations

import math

from annelid.body import compile_robot, worm_of
from annelid.config import RunConfig
from annelid.errors import SimulationStopped
from annelid.live.history import History, Moment, history_of
from annelid.live.lines_and_arrows import Painter, PlanarPainter
from annelid.live.live_worm import LiveWorm
from annelid.live.robot_painter import RobotPainter
from annelid.simulation.runfile import Run
from annelid.simulation.worm import compile_worm

SLOWEST, FASTEST = 0.05, 10.0  # simulated seconds per second


class Player:
    """Shows a history, playing from its first moment; at the end of a living worm's the worm goes on, a run's stops.

    Attributes:
        worm: The living worm, or None for a recorded run.
        playing: Whether time goes on.
        speed: Simulated seconds per second, as wanted.
        at_end: Whether the last moment is shown: of a living worm the present.
        stopped: The sentence of the guard that stopped the worm, or an empty one.
    """

    def __init__(self, source: LiveWorm | History, speed: float = 1.0) -> None:
        self.worm = source if isinstance(source, LiveWorm) else None
        self._history = None if isinstance(source, LiveWorm) else source
        self.speed = speed
        self.stopped = ""
        self._rewind()

    @property
    def history(self) -> History:
        """What can be shown."""
        if self.worm is not None:
            return self.worm.history
        assert self._history is not None
        return self._history

    @property
    def moment(self) -> Moment:
        """What is shown now; of a worm that is followed the newest, up to a step of its body ahead of the clock."""
        return self.history.at(self.history.span_s[1] if self.at_end else self._clock_s)

    def restart(self) -> None:
        """Starts a living worm anew, and a recorded run from its beginning."""
        if self.worm is not None:
            self.worm.restart()
        self.stopped = ""
        self._rewind()

    def toggle(self) -> None:
        """Pauses where it plays, and plays where it is paused."""
        self.pause() if self.playing else self.play()

    def play(self) -> None:
        """Lets time go on; a run that has ended begins again."""
        if self.worm is None and self.at_end:
            self._rewind()
        self.playing = True

    def pause(self) -> None:
        """Stops time."""
        self.playing = False

    def seek(self, time_s: float) -> None:
        """Shows another time and pauses there."""
        first, last = self.history.span_s
        self._clock_s = min(max(time_s, first), last)
        self.at_end = self._clock_s >= last
        self.playing = False

    def go_live(self) -> None:
        """Shows the last moment and plays: a living worm goes on from there."""
        self.seek(self.history.span_s[1])
        self.playing = self.worm is not None and not self.stopped

    def tick(self, elapsed_s: float, deadline: float = math.inf) -> None:
        """Lets so much wall-clock time pass, with no step of the worm after a deadline of `time.perf_counter`.

        A worm that is too slow for the wanted speed is as late as it is: nothing is caught up.
        """
        if not self.playing:
            return
        wanted = self._clock_s + self.speed * elapsed_s
        if wanted >= self.history.span_s[1]:
            self.at_end = True
            if self.worm is not None and not self.stopped:
                try:
                    self.worm.advance(wanted, deadline)
                except SimulationStopped as stop:
                    self.stopped, self.playing = str(stop), False
            else:
                self.playing = False
        self._clock_s = min(wanted, self.history.span_s[1])

    def _rewind(self) -> None:
        first, last = self.history.span_s
        self._clock_s = first
        self.at_end = first >= last
        self.playing = True


AnyPainter = Painter | PlanarPainter | RobotPainter


def player_of(source: RunConfig | Run, speed: float = 1.0, *, grain_m: float = 0.0) -> tuple[Player, AnyPainter]:
    """Returns the player of a configuration, which is run, or of a run, and what paints it.

    Args:
        source: The configuration or the run.
        speed: Simulated seconds per second.
        grain_m: What places are rounded to, where that is done.

    Raises:
        ConfigError: The body cannot be viewed, or not be built.
        RunFileError: The run holds no postures.
    """
    config = source.config if isinstance(source, Run) else source
    is_robot, is_planar = config.body.own_model is not None, config.body.is_planar
    if not (is_robot or is_planar):
        worm_of(config)
    anatomy = n_coordinates = None
    if isinstance(source, Run):
        if is_robot:
            n_coordinates = compile_robot(config).nq
        elif not is_planar:
            anatomy = compile_worm(config)
            n_coordinates = anatomy.model.nq
        player = Player(history_of(source, n_coordinates), speed)
    else:
        worm = LiveWorm(config)
        player, anatomy = Player(worm, speed), None if is_robot or is_planar else worm.plant.anatomy
    if is_robot:
        return player, RobotPainter(config, player.moment)
    return player, PlanarPainter(player.moment, grain_m) if anatomy is None else Painter(anatomy, config, grain_m)
