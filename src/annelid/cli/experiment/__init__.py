"""The commands `experiment ..`: what is done to a worm to learn about it."""

from __future__ import annotations

import typer

from annelid.cli.entry import Command
from annelid.cli.experiment.crawling import (
    pipes_command,
    slip_command,
    slip_detector_command,
    speed_command,
    turning_command,
)
from annelid.cli.experiment.load_frame import load_frame_command
from annelid.cli.experiment.weak_middle import weak_middle_command

__all__ = ["experiment"]

experiment = typer.Typer(no_args_is_help=True, help="Do an experiment on a worm.")

for _name, _command in {
    "load-frame": load_frame_command,
    "weak-middle": weak_middle_command,
    "speed": speed_command,
    "slip": slip_command,
    "slip-detector": slip_detector_command,
    "turning": turning_command,
    "pipes": pipes_command,
}.items():
    experiment.command(_name, cls=Command)(_command)
