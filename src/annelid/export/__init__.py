"""What goes elsewhere: a run as tables, pictures, a page or a model; a network or a controller as C99."""

from annelid.export.c_source import Firmware
from annelid.export.firmware import controller_firmware, network_firmware
from annelid.export.formats import FORMATS, Format, find_format
from annelid.export.host import HostFirmware
from annelid.export.tables import Selection, selected

__all__ = [
    "FORMATS",
    "Firmware",
    "Format",
    "HostFirmware",
    "Selection",
    "controller_firmware",
    "find_format",
    "network_firmware",
    "selected",
]
