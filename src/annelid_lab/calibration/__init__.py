"""Identification: a worm's parameters from several measured experiments at once, with intervals.

A study (`study`) names a worm, parameters and experiments. Each kind of experiment (`kinds`) reads its data and says
what the worm would have given. `fit` weighs the residuals, fits, and finds the intervals; `report` shows them. The load
frame (`frame`) is also used alone.
"""

from annelid_lab.calibration.frame import (
    Loop,
    cable_force,
    cable_per_diameter,
    draw_loops,
    frame_table,
    load_frame,
    read_loop,
    size_of,
    write_loop,
)
from annelid_lab.calibration.report import Identified, identify, tables, write_identified
from annelid_lab.calibration.simulations import Simulations
from annelid_lab.calibration.study import ROBOT, IdentifyStudy, load_identify_study

__all__ = [
    "ROBOT",
    "Identified",
    "IdentifyStudy",
    "Loop",
    "Simulations",
    "cable_force",
    "cable_per_diameter",
    "draw_loops",
    "frame_table",
    "identify",
    "load_frame",
    "load_identify_study",
    "read_loop",
    "size_of",
    "tables",
    "write_identified",
    "write_loop",
]
