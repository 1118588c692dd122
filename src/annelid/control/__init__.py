"""Everything that turns sensation into activation."""

from annelid.control.adaptive import AdaptiveController
from annelid.control.base import OpenLoopController, SegmentController
from annelid.control.callable import CallableController
from annelid.control.oscillators import HeteroclinicController, PhaseChainController
from annelid.control.program import ProgramController
from annelid.control.sns import CopySettings, SnsController
from annelid.control.stretch_sensor import StretchSensor
from annelid.control.waves import SineController, TimedController

__all__ = [
    "AdaptiveController",
    "CallableController",
    "CopySettings",
    "HeteroclinicController",
    "OpenLoopController",
    "PhaseChainController",
    "ProgramController",
    "SegmentController",
    "SineController",
    "SnsController",
    "StretchSensor",
    "TimedController",
]
