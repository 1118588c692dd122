"""What is shown when: a clock that plays, pauses, goes slower or faster, and back through what is remembered."""

from __future__ import annotations

import math

from annelid.body import worm_of
from annelid.config import RunConfig
from annelid.errors import ConfigError, SimulationStopped
from annelid.live.history import History, Moment, history_of
from annelid.live.live_worm import LiveWorm
from annelid.simulation.anatomy import Anatomy
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


def player_of(source: RunConfig | Run, speed: float = 1.0) -> tuple[Player, Anatomy | None]:
    """Returns the player of a configuration, which is run, or of a run, and the compiled body of a 3D worm.

    Raises:
        ConfigError: The body is a robot that a file describes, or cannot be built.
        RunFileError: The run holds no postures.
    """
    body = source.config.body if isinstance(source, Run) else source.body
    if body.own_model is not None:
        raise ConfigError(
            f"body.kind = {body.kind!r} cannot be viewed: the live view draws the mesh of annelid's own worms, which a "
            "robot from an MJCF file does not have; use annelid run, and annelid draw RUN --video robot.mp4"
        )
    if not body.is_planar:
        worm_of(source.config if isinstance(source, Run) else source)
    if isinstance(source, Run):
        anatomy = None if body.is_planar else compile_worm(source.config)
        return Player(history_of(source, None if anatomy is None else anatomy.model.nq), speed), anatomy
    worm = LiveWorm(source)
    return Player(worm, speed), None if body.is_planar else worm.plant.anatomy
