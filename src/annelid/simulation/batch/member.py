"""One worm of a batch with its run file: it moves, is watched, recorded, and ends by itself."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from annelid.config import RunConfig
from annelid.errors import RunFileError, SimulationStopped
from annelid.protocols import Array, Records
from annelid.simulation.anatomy import Movement
from annelid.simulation.batch.body import BatchWorm
from annelid.simulation.coupling import Coupling
from annelid.simulation.loop import recorder_of
from annelid.simulation.recorder import Values
from annelid.simulation.runfile import FILE_NAME


class Member:
    """A worm with its controller and its run file.

    Attributes:
        row: Its number in the batch.
        coupling: Worm and controller.
        worm: The worm.
        status: How it ended, one of `annelid.simulation.runfile.STATUSES`.
        message: Why it ended before its time; empty if it did not.
    """

    def __init__(self, row: int, config: RunConfig, coupling: Coupling, worm: BatchWorm, folder: Path) -> None:
        """Lays out the run file.

        Raises:
            RunFileError: The file cannot be made.
        """
        self.row = row
        self.coupling = coupling
        self.worm = worm
        self.status = "running_or_killed"
        self.message = ""
        controller = coupling.controller
        self._read_controller = controller.read if isinstance(controller, Records) else _nothing
        self._recorder = recorder_of(config, coupling, None, folder / FILE_NAME)

    @property
    def running(self) -> bool:
        """Whether it has not ended yet."""
        return self.status == "running_or_killed"

    def advance(self, n_steps: int, step: int, activation: Array, moved: Movement | None) -> None:
        """Takes note of control steps, and of what the body has come to if it moved at their end.

        Args:
            n_steps: How many were taken.
            step: How many that makes since time zero.
            activation: What the controller gave at last.
            moved: What the body has come to, or None if it has not moved.

        Raises:
            SimulationStopped: A value is not finite, or body or controller is alarmed.
        """
        coupling = self.coupling
        coupling.sensation = self.worm.strode(n_steps, moved)
        coupling.step = step
        coupling.activation = activation
        if moved is not None:
            coupling.watch()

    def record(self, wall_time_s: float) -> None:
        """Records a sample and a frame, where one is due.

        Raises:
            RunFileError: The file cannot be written.
        """
        coupling, recorder = self.coupling, self._recorder
        if coupling.step % coupling.schedule.sample_every == 0:
            own: Values = {"activation": coupling.activation, "wall_time": wall_time_s}
            recorder.sample(self.worm.read(False), self._read_controller(False), own)
        if coupling.step % coupling.schedule.frame_every == 0:
            recorder.frame(self.worm.read(True), self._read_controller(True))

    def flush(self) -> None:
        """Writes what was recorded so far."""
        self._recorder.flush()

    def checkpoint(self) -> None:
        """Writes the state, so that the run can be continued from here."""
        state = self.coupling.checkpoint()
        if state is not None:
            self._recorder.checkpoint(state.to_bytes())
        self._recorder.warn(self.coupling.doubts())

    def finish(self, interrupted_by: str | None) -> None:
        """Writes all that is left and closes the file: the run is complete, or a signal of that name ended it."""
        self.checkpoint()
        if interrupted_by is None:
            self._end("complete", "", whole=True)
        else:
            self._end("interrupted", self.coupling.at(f"{interrupted_by} ended the run"), whole=True)

    def end_with(self, error: BaseException) -> None:
        """Ends the run because of an error, as a single run ends: the file says why."""
        if not self.running:
            return
        with suppress(RunFileError):
            if isinstance(error, SimulationStopped):
                self._recorder.warn(self.coupling.doubts())
                self._end("stopped_by_guard", str(error), whole=True)
            elif isinstance(error, RunFileError):
                self._end("disk_failure", str(error), whole=False)
            elif isinstance(error, KeyboardInterrupt):
                self._end("interrupted", self.coupling.at("interrupted"), whole=False)
            else:
                self._end("failed", self.coupling.at(f"{type(error).__name__}: {error}"), whole=True)

    def _end(self, status: str, message: str, whole: bool) -> None:
        self.status, self.message = status, message
        if whole:
            self._recorder.finish(status, message)
        else:
            self._recorder.close(status, message)


def _nothing(frame: bool) -> Values:
    return {}
