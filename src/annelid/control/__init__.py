"""Everything that turns sensation into activation."""

from annelid.control.callable import CallableController
from annelid.control.sns import SnsController
from annelid.control.stretch_sensor import StretchSensor

__all__ = ["CallableController", "SnsController", "StretchSensor"]
