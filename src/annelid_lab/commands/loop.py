"""The command `loop`: robots and firmware in the loop."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from annelid.cli import (
    EXIT_INTERRUPTED,
    EXIT_STOPPED,
    Assignments,
    NamedPreset,
    Segments,
    command,
    complain,
    config_of,
    locked_folder,
    overrides_of,
    print_paths,
    print_results,
    print_run,
    print_worm,
    wants_json,
)

if TYPE_CHECKING:
    from rich.table import Table

_LINE = "a serial port as PORT@BAUD, or udp:HOST:PORT"
Ticks = Annotated[
    tuple[int, int],
    typer.Option(metavar="RELAXED CONTRACTED", help="Servo positions at activation 0 and 1; a turn has 4096 steps."),
]
Potentiometer = Annotated[
    tuple[float, float],
    typer.Option(metavar="COUNTS M_PER_COUNT", help="Reading of a potentiometer at rest, and m per count."),
]
_TICKS, _POTENTIOMETER = (1024, 3072), (512.0, 0.3 / 4095)


@command("loop", "Robot")
def loop_command(
    preset: NamedPreset,
    robot: Annotated[
        str | None, typer.Option(metavar="LINE", help=f"A robot that speaks annelid's protocol: {_LINE}.")
    ] = None,
    servos: Annotated[
        str | None,
        typer.Option(metavar="LINE", help="A robot of Dynamixel servos: a serial port as PORT@BAUD."),
    ] = None,
    firmware: Annotated[
        str | None, typer.Option(metavar="LINE", help=f"A controller that speaks annelid's protocol: {_LINE}.")
    ] = None,
    pseudo: Annotated[
        bool, typer.Option("--pseudo", help="A simulated robot of servos, to try it without one.")
    ] = False,
    rate: Annotated[float, typer.Option(help="Exchanges per second.", min=1.0, max=10_000.0)] = 100.0,
    watchdog: Annotated[
        int, typer.Option(min=1, max=10_000, help="Stop after this number of periods without a valid answer.")
    ] = 10,
    least: Annotated[
        float, typer.Option(help="Smallest activation that is sent to a robot, a share from 0 to 1.")
    ] = 0.0,
    most: Annotated[float, typer.Option(help="Largest activation that is sent to a robot, a share from 0 to 1.")] = 1.0,
    most_rate: Annotated[
        float | None, typer.Option(help="Largest change of activation per second  [default: no limit]")
    ] = None,
    ticks: Ticks = _TICKS,
    potentiometer: Potentiometer = _POTENTIOMETER,
    protocol: Annotated[int, typer.Option(min=1, max=2, help="Protocol of the servos, 1.0 or 2.0.")] = 2,
    wheel: Annotated[bool, typer.Option("--wheel", help="Servos turn without end: positions become speeds.")] = False,
    assignments: Assignments = None,
    segments: Segments = None,
    duration: Annotated[float | None, typer.Option(help="Time to run, s.")] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder for the results  [default: runs/NAME-NNN, the next free number]"),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the run that is in the folder.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar and no tables.")] = False,
) -> None:
    """Run a robot, firmware, or both in real time, and record it as a run.

    With a robot, the preset's controller drives it. With firmware, as `annelid export-network --wire` writes it, the
    firmware drives the preset's simulated body. With both, the firmware drives the robot. Writes run.nc, for `annelid
    show` and `annelid compare`, and loop.csv: latency and jitter, missed deadlines and lost answers.

    At the end the robot is sent zero activation and a stop. The same happens on Ctrl-C, after the time of the watchdog,
    and after any error. docs/wire.md describes the protocol, and what stops a robot.

    \b
    annelid loop riddle2023-rods --pseudo                 without hardware
    annelid loop riddle2023-rods --servos /dev/ttyUSB0@1000000
    annelid loop riddle2023-rods --servos /dev/ttyUSB0 --most 0.6   gently
    annelid loop riddle2023-rods --robot udp:192.168.1.7:4242 --rate 50
    annelid loop riddle2023-rods --firmware /dev/ttyACM0  simulated worm
    """
    from annelid.output import write_csv
    from annelid.simulation import build_plant
    from annelid_lab.loop import Limits, PseudoRobot, Wiring, drive, open_link

    config = config_of(preset, overrides_of(assignments, duration_s=duration), segments)
    limits = Limits(least, most, math.inf if most_rate is None else most_rate)
    wiring = Wiring(*ticks, *potentiometer, protocol, wheel)
    has_servos = servos is not None or pseudo
    if robot is None and firmware is None and not has_servos:
        raise typer.BadParameter("name what is real: --robot, --servos or --firmware; else --pseudo, or annelid run")
    if servos is not None and pseudo:
        raise typer.BadParameter("--pseudo stands for a robot of servos: leave out --servos")
    if not has_servos and wiring != Wiring():
        raise typer.BadParameter(
            "--ticks, --potentiometer, --protocol and --wheel are of a robot of servos: they need --servos"
        )
    if robot is None and not has_servos and (least, most, most_rate) != (0.0, 1.0, None):
        raise typer.BadParameter("--least, --most and --most-rate are limits of a robot: they need --robot or --servos")
    lines = {name: text for name, text in (("robot", robot), ("servos", servos), ("firmware", firmware)) if text}
    folder = locked_folder(out, config.name)
    links: dict[str, Any] = {}
    if pseudo:
        body = build_plant(config)
        links["servos"] = PseudoRobot(body.n_segments, body.n_muscles, wiring=wiring)
    try:
        for name, text in lines.items():
            links[name] = open_link(text)
        driven = drive(
            config,
            folder,
            **links,
            rate_hz=rate,
            watchdog=watchdog,
            limits=limits,
            wiring=wiring,
            progress=False if quiet else None,
            overwrite=force,
        )
    finally:
        for link in links.values():
            link.close()
    run = driven.run
    print_worm(config, quiet=quiet)
    print_run(run, quiet=quiet)
    if not wants_json():
        print_paths([run.path])
    rows = _rows(driven.report)
    times = write_csv(run.path.with_name("loop.csv"), list(rows[0]), [list(row.values()) for row in rows])
    print_results([times], _table(driven.report, rows), quiet=quiet)
    if run.status != "complete":
        complain(f"{run.message}; what was recorded is in {run.path}")
        raise typer.Exit(EXIT_INTERRUPTED if run.status == "interrupted" else EXIT_STOPPED)


def _rows(report: dict[str, Any]) -> list[dict[str, Any]]:
    """Times of commands and answers, in s, as records."""
    there = [(who, report[who]) for who in ("robot", "firmware") if who in report]
    found = [
        ("command late", report["missed_deadlines"], report["lateness_s"]),
        *((f"answer of the {who}", its["lost"], its["latency_s"]) for who, its in there),
    ]
    return [
        {"what": what, "periods": report["periods"], "missed": n, **{f"{name}_s": each for name, each in times.items()}}
        for what, n, times in found
    ]


def _table(report: dict[str, Any], rows: list[dict[str, Any]]) -> Table:
    from rich.table import Table

    title = f"{report['periods']} periods of {1e3 / report['rate_hz']:g} ms, times in ms"
    table = Table("", "missed, lost", "median", "99 %", "99.9 %", "largest", title=title, title_justify="left")
    for row in rows:
        times = [row[name] for name in ("median_s", "p99_s", "p99_9_s", "max_s")]
        table.add_row(
            row["what"], str(row["missed"]), *("-" if each is None else f"{1e3 * each:.3f}" for each in times)
        )
    return table
