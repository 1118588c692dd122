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
from annelid.protocols import Controller, Plant, Records, Sensation
from annelid.simulation.assemble import as_controller, build_plant
from annelid.simulation.coupling import Coupling, start
from annelid.simulation.interruption import Interruption
from annelid.simulation.lock import locks
from annelid.simulation.progress import ProgressCallback, reporting
from annelid.simulation.recorder import (
    Recorder,
    Values,
    global_attributes,
    layout,
    loop_signals,
    recordable_of,
    sensation_signals,
    sensation_values,
)
from annelid.simulation.resume import Origin, continued_config, origin_of
from annelid.simulation.runfile import FILE_NAME, Run, open_run, refuse_used_folder

FLUSH_INTERVAL_S = 0.5
CHECKPOINT_INTERVAL_S = 1.0
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
    recorder = recorder_of(config, simulation, origin, out / FILE_NAME)
    with reporting(progress, simulation.schedule.start * simulation.schedule.timestep_s, config.duration_s) as report:
        _record(simulation, recorder, report)
    return open_run(out / FILE_NAME)


def recorder_of(config: RunConfig, simulation: Coupling, origin: Origin | None, path: Path) -> Recorder:
    """Lays out the run file of a simulation that is about to begin.

    Args:
        config: The configuration, which the file carries whole.
        simulation: Plant and controller at their start.
        origin: The run that it continues, or None.
        path: The run file.

    Raises:
        RunFileError: The file cannot be made.
    """
    plant = simulation.plant
    of_plant = recordable_of(plant) if isinstance(plant, Records) else sensation_signals(simulation.sensation)
    parts = [of_plant, recordable_of(simulation.controller), loop_signals(plant.n_muscles)]
    first = simulation.checkpoint()
    packed = None if first is None else first.to_bytes()
    plan = layout(simulation.schedule, parts, simulation.sensation.rest_stretch_m, packed)
    # The configured controller overrides this with its own attribute; without it the file would name that one.
    attrs: dict[str, Any] = {"controller": getattr(simulation.controller, "name", type(simulation.controller).__name__)}
    attrs |= global_attributes(config, parts) | ({} if origin is None else origin.attrs())
    recorder = Recorder(path, plan, attrs)
    if packed is not None:
        recorder.checkpoint(packed)
    return recorder


def _record(simulation: Coupling, recorder: Recorder, report: ProgressCallback | None) -> None:
    """Runs to the end and sees to it that the file says how it ended, however it ends."""
    with Interruption() as interruption:
        try:
            _run(simulation, recorder, report, interruption)
            interrupted = simulation.step < simulation.schedule.end
            checkpoint = simulation.checkpoint()
            if checkpoint is not None:
                recorder.checkpoint(checkpoint.to_bytes())
            if interrupted:
                _finish(simulation, recorder, "interrupted", simulation.at(f"{interruption.requested} ended the run"))
            else:
                _finish(simulation, recorder, "complete")
        except SimulationStopped as stop:
            with suppress(RunFileError):
                _finish(simulation, recorder, "stopped_by_guard", str(stop))
            raise
        except RunFileError as failure:
            with suppress(RunFileError):
                recorder.close("disk_failure", str(failure))
            raise
        except KeyboardInterrupt:
            # A second one asks to leave now; it may also have come in the middle of a write.
            with suppress(RunFileError):
                recorder.close("interrupted", simulation.at("interrupted"))
            raise
        except BaseException as error:
            with suppress(RunFileError):
                recorder.finish("failed", simulation.at(f"{type(error).__name__}: {error}"))
            raise


def _finish(simulation: Coupling, recorder: Recorder, status: str, message: str = "") -> None:
    recorder.warn(simulation.doubts())
    recorder.finish(status, message)


def _run(simulation: Coupling, recorder: Recorder, report: ProgressCallback | None, interruption: Interruption) -> None:
    schedule = simulation.schedule
    sample_every, frame_every = schedule.sample_every, schedule.frame_every
    began = now = perf_counter()
    next_flush, next_report = began + FLUSH_INTERVAL_S, began
    next_checkpoint = began + CHECKPOINT_INTERVAL_S
    read_plant, read_controller = _reader(simulation)

    def record() -> None:
        if simulation.step % sample_every == 0:
            own: Values = {"activation": simulation.activation, "wall_time": now - began}
            recorder.sample(read_plant(False), read_controller(False), own)
        if simulation.step % frame_every == 0:
            recorder.frame(read_plant(True), read_controller(True))

    if simulation.step == 0:
        record()
    while simulation.step < schedule.end and interruption.requested is None:
        simulation.advance()
        now = perf_counter()
        record()
        if now >= next_flush:
            recorder.flush()
            next_flush = now + FLUSH_INTERVAL_S
        if now >= next_checkpoint:
            checkpoint = simulation.checkpoint()
            if checkpoint is not None:
                recorder.checkpoint(checkpoint.to_bytes())
            recorder.warn(simulation.doubts())
            cost = perf_counter() - now
            next_checkpoint = now + max(CHECKPOINT_INTERVAL_S, cost / _CHECKPOINT_SHARE)
        if report is not None and now >= next_report:
            report(simulation.step * schedule.timestep_s, now - began)
            next_report = now + PROGRESS_INTERVAL_S
    if report is not None:
        report(simulation.step * schedule.timestep_s, now - began)


def _reader(simulation: Coupling) -> tuple[Callable[[bool], Values], Callable[[bool], Values]]:
    """Returns what reads the plant's and the controller's present values, of frames or of signals."""
    plant, controller = simulation.plant, simulation.controller
    nothing: Values = {}

    def read_sensation(frame: bool) -> Values:
        return nothing if frame else sensation_values(simulation.sensation)

    return (
        plant.read if isinstance(plant, Records) else read_sensation,
        controller.read if isinstance(controller, Records) else lambda frame: nothing,
    )
