"""Everything that turns sensation into activation."""

from annelid.control.base import CallableController, OpenLoopController, SegmentController
from annelid.control.network import NetworkController, Sense
from annelid.control.open_loop import ProgramController, SineController, TimedController
from annelid.control.oscillators import HeteroclinicController, PhaseChainController
from annelid.control.own import own_controller
from annelid.control.sns import AdaptiveController, CopySettings, SnsController
from annelid.control.stretch_sensor import StretchSensor

__all__ = [
    "AdaptiveController",
    "CallableController",
    "CopySettings",
    "HeteroclinicController",
    "NetworkController",
    "OpenLoopController",
    "PhaseChainController",
    "ProgramController",
    "SegmentController",
    "Sense",
    "SineController",
    "SnsController",
    "StretchSensor",
    "TimedController",
    "own_controller",
]
