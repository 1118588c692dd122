"""Everything that turns sensation into activation."""

from annelid.control.base import (
    SENSED,
    CallableController,
    Coded,
    ControllerCode,
    OpenLoopController,
    SegmentController,
    Slope,
)
from annelid.control.network import NetworkController, Sense
from annelid.control.open_loop import ProgramController, SineController, TimedController
from annelid.control.own import own_controller
from annelid.control.sns import DRIVE_HINT, AdaptiveController, SnsController, paper_controller
from annelid.control.stretch_sensor import StretchSensor, lengthening_m
from annelid.lazy import moved

__all__ = [
    "DRIVE_HINT",
    "SENSED",
    "AdaptiveController",
    "CallableController",
    "Coded",
    "ControllerCode",
    "NetworkController",
    "OpenLoopController",
    "ProgramController",
    "SegmentController",
    "Sense",
    "SineController",
    "Slope",
    "SnsController",
    "StretchSensor",
    "TimedController",
    "lengthening_m",
    "own_controller",
    "paper_controller",
]
__getattr__ = moved(__name__, "annelid_studies.oscillators")
