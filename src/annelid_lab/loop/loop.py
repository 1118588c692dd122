"""A run whose body, controller or both are real: the loop of a simulation, at the pace of the wall clock."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from annelid.clock import SLACK_S
from annelid.config import RunConfig
from annelid.control import lengthening_m
from annelid.errors import ConfigError, SimulationStopped, require_at_least, require_positive
from annelid.protocols import Controller, Plant, Sensation
from annelid.simulation import ProgressCallback, Run, build_controller, build_plant, locks, open_run, simulate
from annelid_lab.loop.frames import MOST_STEPS, Interface, Role
from annelid_lab.loop.links import Link
from annelid_lab.loop.remote import PacedPlant, RemoteController, RemotePlant
from annelid_lab.loop.servos import ServoPlant, Wiring
from annelid_lab.loop.session import Limits, Pace, WirePartner, percentiles


@dataclass(frozen=True)
class Driven:
    """What a loop leaves.

    Attributes:
        run: The run, whole however it ended.
        report: Latency and lateness, s (median, 99th and 99.9th percentile, largest), missed deadlines, lost answers.
    """

    run: Run
    report: dict[str, Any]


@locks("out")
def drive(
    config: RunConfig,
    out: str | Path,
    *,
    robot: Link | None = None,
    servos: Link | None = None,
    firmware: Link | None = None,
    rate_hz: float = 100.0,
    watchdog: int = 10,
    limits: Limits | None = None,
    wiring: Wiring | None = None,
    controller: Controller | Callable[[Sensation], ArrayLike] | None = None,
    progress: bool | ProgressCallback | None = None,
    overwrite: bool = False,
    clock: Callable[[], float] = time.perf_counter,
    sleep: Callable[[float], None] = time.sleep,
) -> Driven:
    """Runs a robot with annelid's controller, firmware with the simulated body, or a robot with firmware.

    It writes the run file of `annelid.simulate`. However it ends, the robot is sent zero activation and a stop first.

    Args:
        config: The configuration: the body gives numbers and rest lengths of a robot.
        out: Folder for the run file.
        robot: A line to a robot that speaks the protocol of docs/wire.md.
        servos: A line to a robot of servos, instead.
        firmware: A line to a controller that speaks the protocol of docs/wire.md.
        rate_hz: Exchanges per second of the wall clock.
        watchdog: Periods without an answer after which the loop stops.
        limits: On what is sent to a robot.
        wiring: Of a robot of servos.
        controller: Instead of the configured one, as in `annelid.simulate`; not beside firmware. What a robot sends are
            its ``senses``, names in `annelid.control.SENSED`: lengthening alone if it has none.
        progress: As in `annelid.simulate`.
        overwrite: Allow a folder that is not empty.
        clock: Time that never goes back, s.
        sleep: Waits so many seconds.

    Returns:
        The run, also one that a guard stopped, and the times.

    Raises:
        ConfigError: Nothing is real, nobody answers, or what answers does not fit.
        RunFileError: The file cannot be written.
    """
    if robot is None and servos is None and firmware is None:
        raise ConfigError("nothing here is real: name a robot, servos or firmware, or use annelid.simulate")
    if (robot is not None and servos is not None) or (controller is not None and firmware is not None):
        raise ConfigError("a loop has one body and one controller: name a robot or servos, a controller or firmware")
    require_positive(rate_hz=rate_hz)
    require_at_least(1, watchdog=watchdog)
    timestep_s = config.clock.control_timestep_s
    n_steps = round(1.0 / rate_hz / timestep_s)
    if not 1 <= n_steps <= MOST_STEPS or abs(n_steps * timestep_s - 1.0 / rate_hz) > SLACK_S:
        raise ConfigError(
            f"rate_hz = {rate_hz:g}: a period must be 1 .. {MOST_STEPS} control steps of {timestep_s:g} s, whole ones; "
            f"for example {1.0 / timestep_s / min(max(n_steps, 1), MOST_STEPS):g} Hz"
        )
    body = build_plant(config)
    interface = _interface(config, body, controller)
    pace = Pace(1.0 / rate_hz, clock, sleep)
    sensation = body.reset(0)
    rest_m = lengthening_m(sensation.rest_stretch_m, 0.0 * sensation.rest_stretch_m)
    limits, plant = limits or Limits(), body
    if robot is not None:
        partner = WirePartner(Role.BODY, robot, pace, interface, n_steps, watchdog)
        plant = RemotePlant(partner, pace, limits, rest_m, interface)
    elif servos is not None:
        if more := [name for name in interface.senses if name != "lengthening_m"]:
            raise ConfigError(f"this controller needs {', '.join(more)}, which a robot of servos does not sense")
        wiring = wiring or Wiring()
        plant = ServoPlant(servos, pace, limits, rest_m, body.n_muscles, timestep_s, watchdog, wiring)
    remote = None
    if firmware is not None:
        partner = WirePartner(Role.CONTROLLER, firmware, pace, interface, n_steps, watchdog)
        controller = remote = RemoteController(partner, pace, interface, n_steps, keeps_pace=plant is body)
    parts = [part for part in (plant, remote) if isinstance(part, PacedPlant | RemoteController)]
    try:
        run = simulate(config, out, plant=plant, controller=controller, progress=progress, overwrite=overwrite)
    except SimulationStopped:
        run = open_run(out)
    finally:
        for part in parts:
            part.stop()
    report: dict[str, Any] = {"rate_hz": rate_hz, "periods": len(pace.late_s), "missed_deadlines": pace.missed}
    report |= {"slipped_s": pace.slipped_s, "lateness_s": percentiles(pace.late_s)}
    return Driven(run, report | {part.partner.who: part.partner.to_dict() for part in parts})


def _interface(config: RunConfig, body: Plant, controller: object | None) -> Interface:
    """What passes between body and controller: what the controller senses, the configured one if None; activation."""
    own = build_controller(config.model_copy(update={"trial": None}), body) if controller is None else controller
    senses = getattr(own, "senses", ("lengthening_m",))
    return Interface(tuple(senses), body.n_segments, body.n_muscles, round(1e6 * config.clock.control_timestep_s))
