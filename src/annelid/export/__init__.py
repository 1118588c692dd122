"""What goes elsewhere: runs as tables, NWB, pictures, pages, models; controllers as C99; networks as C99 or LEMS."""

from annelid.export.c_source import Firmware
from annelid.export.firmware import controller_firmware, controller_network, network_firmware
from annelid.export.formats import FORMATS, Format, find_format
from annelid.export.host import HostFirmware
from annelid.export.lems import lems_text, read_lems
from annelid.export.tables import Selection, selected

__all__ = [
    "FORMATS",
    "Firmware",
    "Format",
    "HostFirmware",
    "Selection",
    "controller_firmware",
    "controller_network",
    "find_format",
    "lems_text",
    "network_firmware",
    "read_lems",
    "selected",
]
