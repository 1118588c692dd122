"""Everything that turns sensation into activation."""

from annelid.control.callable import CallableController
from annelid.control.program import ProgramController
from annelid.control.sns import SnsController
from annelid.control.stretch_sensor import StretchSensor

__all__ = ["CallableController", "ProgramController", "SnsController", "StretchSensor"]
