"""The loop: sensation -> controller -> plant, one control step at a time, recorded as it goes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from time import perf_counter
from typing import Any

from numpy.typing import ArrayLike

from annelid.config import RunConfig, as_config
from annelid.errors import ConfigError, RunFileError, SimulationStopped
from annelid.protocols import Controller, Plant, Records, Sensation, Stoppable, Values
from annelid.simulation.lock import locks
from annelid.simulation.progress import Interruption, ProgressCallback, reporting
from annelid.simulation.recorder import Recorder, Senses, global_attributes, loop_signals
from annelid.simulation.resume import Origin, continued_config, origin_of
from annelid.simulation.runfile import FILE_NAME, Run, open_run, refuse_used_folder
from annelid.simulation.stepping import Simulation, as_controller, build_plant, start

PROGRESS_INTERVAL_S = 0.2

# Checkpoints of a large state are spaced so that they take no more than this share of the time.
_CHECKPOINT_SHARE = 0.02


@locks("out")
def simulate(
    config: RunConfig | str | Path | Mapping[str, Any] | None,
    out: str | Path,
    *,
    plant: Plant | None = None,
    controller: Controller | Callable[[Sensation], ArrayLike] | None = None,
    resume: Run | str | Path | None = None,
    progress: bool | ProgressCallback | None = None,
    overwrite: bool = False,
) -> Run:
    """Runs a worm and writes its run file ``run.nc`` as it goes.

    The first sample is the state at time zero, the last one that of ``config.duration_s``. Ctrl-C or SIGTERM
    ends the run after the control steps in progress (at the latest when the body has moved), with everything up to
    there in the file; a second one raises KeyboardInterrupt.

    Args:
        config: The configuration, or what `annelid.load_config` makes one of; None for that of the run to continue.
        out: Folder for the run file; made if it is not there.
        plant: The body, instead of the one that the configuration describes.
        controller: The controller, likewise, or a plain function from sensation to activation.
        resume: A run to continue from its last checkpoint. Then ``config`` may differ from that run's in
            ``duration_s`` (which counts from time zero of the first run), ``record`` and ``name``, the file
            holds the new part only, and plant and controller go on bit for bit.
        progress: Own function of the simulated and the wall-clock time (s), called at most 5 times a
            second; True for a progress bar on stderr, False for none, None for one if stderr is a terminal.
        overwrite: Allow a folder that is not empty, and replace its run file.

    Returns:
        The run, with its status ``complete`` or ``interrupted``.

    Raises:
        ConfigError: No configuration, one that does not continue the given run, or a folder in use.
        RunFileError: The file cannot be written, also in the middle (what was written stays readable), another
            process writes into the folder, or the run to continue cannot be read or has no valid checkpoint.
        SimulationStopped: A guard stopped the run; its file is kept.
    """
    out = Path(out)
    if config is not None:
        config = as_config(config)
    refuse_used_folder(out, overwrite)
    origin = None if resume is None else origin_of(resume)
    if origin is not None:
        config = continued_config(config, origin, out)
    if config is None:
        raise ConfigError("a run needs a configuration, or a run to continue")
    plant = plant or build_plant(config)
    simulation = start(config, plant, as_controller(controller, config, plant), origin)
    run = RecordedRun(config, simulation, out / FILE_NAME, origin)
    with (
        reporting(progress, simulation.schedule.start * simulation.schedule.timestep_s, config.duration_s) as report,
        Interruption() as interruption,
    ):
        run.run(interruption, report)
    return open_run(out / FILE_NAME)


class RecordedRun:
    """A worm with its controller and its run file, which says how the run ended, however it ends."""

    flush_interval_s = 0.5
    checkpoint_interval_s = 1.0

    def __init__(self, config: RunConfig, simulation: Simulation, path: Path, origin: Origin | None = None) -> None:
        """Lays out the run file of a simulation that is about to begin, or to continue another run."""
        self.simulation = simulation
        plant, controller = simulation.plant, simulation.controller
        sources = [plant if isinstance(plant, Records) else Senses(lambda: simulation.sensation)]
        sources += [controller] if isinstance(controller, Records) else []
        self._readers = [source.read for source in sources]
        parts = [*(source.recordable() for source in sources), loop_signals(plant.n_muscles)]
        first = simulation.checkpoint()
        packed = None if first is None else first.to_bytes()
        # The configured controller overrides this with its own attribute; without it the file would name that one.
        attrs: dict[str, Any] = {"controller": getattr(controller, "name", type(controller).__name__)}
        attrs |= global_attributes(config, parts) | ({} if origin is None else origin.attrs())
        rest_stretch_m = simulation.sensation.rest_stretch_m
        self.recorder = Recorder(path, simulation.schedule, parts, rest_stretch_m, packed, attrs)

    def run(self, interruption: Interruption, report: ProgressCallback | None = None) -> None:
        """Runs to the end, unless interrupted; the file says what error ended it, which is raised."""
        simulation, schedule = self.simulation, self.simulation.schedule
        began = now = perf_counter()
        flush_due, checkpoint_due = began + self.flush_interval_s, began + self.checkpoint_interval_s
        report_due = began
        try:
            if schedule.start == 0:
                self.record(0.0)
            while simulation.step < schedule.end and interruption.requested is None:
                simulation.advance()
                now = perf_counter()
                self.record(now - began)
                if now >= flush_due:
                    self.recorder.flush()
                    flush_due = now + self.flush_interval_s
                if now >= checkpoint_due:
                    self.checkpoint()
                    cost_s = perf_counter() - now
                    checkpoint_due = now + max(self.checkpoint_interval_s, cost_s / _CHECKPOINT_SHARE)
                if report is not None and now >= report_due:
                    report(simulation.step * schedule.timestep_s, now - began)
                    report_due = now + PROGRESS_INTERVAL_S
            self.finish(interruption.requested if simulation.step < schedule.end else None)
            if report is not None:
                report(simulation.step * schedule.timestep_s, now - began)
        except BaseException as error:
            self.end_with(error)
            raise

    def record(self, wall_time_s: float) -> None:
        """Records a sample and a frame, where one is due."""
        simulation, schedule = self.simulation, self.simulation.schedule
        if simulation.step % schedule.sample_every == 0:
            own: Values = {"activation": simulation.activation, "wall_time": wall_time_s}
            self.recorder.sample(*(read(False) for read in self._readers), own)
        if simulation.step % schedule.frame_every == 0:
            self.recorder.frame(*(read(True) for read in self._readers))

    def checkpoint(self) -> None:
        """Writes the state, so that the run can be continued from here, and what is doubtful so far."""
        state = self.simulation.checkpoint()
        if state is not None:
            self.recorder.checkpoint(state.to_bytes())
        self.recorder.warn(self.simulation.doubts())

    def finish(self, interrupted_by: str | None) -> None:
        """Writes all that is left and closes the file: the run is complete, or a signal of that name ended it."""
        self._stop()
        self.checkpoint()
        if interrupted_by is None:
            self.recorder.finish("complete")
        else:
            self.recorder.finish("interrupted", self.simulation.at(f"{interrupted_by} ended the run"))

    def end_with(self, error: BaseException) -> None:
        """Ends the run because of an error; a file that is closed stays as it is."""
        self._stop()
        if self.recorder.closed:
            return
        with suppress(RunFileError):
            if isinstance(error, SimulationStopped):
                self.recorder.warn(self.simulation.doubts())
                self.recorder.finish("stopped_by_guard", str(error))
            elif isinstance(error, RunFileError):
                self.recorder.finish("disk_failure", str(error), whole=False)
            elif isinstance(error, KeyboardInterrupt):
                # A second one asks to leave now; it may also have come in the middle of a write.
                self.recorder.finish("interrupted", self.simulation.at("interrupted"), whole=False)
            else:
                self.recorder.finish("failed", self.simulation.at(f"{type(error).__name__}: {error}"))

    def _stop(self) -> None:
        for part in (self.simulation.plant, self.simulation.controller):
            if isinstance(part, Stoppable):
                part.stop()
