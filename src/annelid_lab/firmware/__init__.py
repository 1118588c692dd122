"""Controllers and networks as C99, for microcontrollers."""

from annelid_lab.firmware.controllers import controller_circuit, controller_firmware, network_firmware
from annelid_lab.firmware.files import Firmware
from annelid_lab.firmware.host import HostFirmware

__all__ = ["Firmware", "HostFirmware", "controller_circuit", "controller_firmware", "network_firmware"]
