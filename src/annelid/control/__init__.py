"""Everything that turns sensation into activation."""

from annelid.control.base import (
    CallableController,
    OpenLoopController,
    OpenLoopKind,
    SavedWrapper,
    SegmentController,
    Slope,
    WrappedController,
)
from annelid.control.circuit import Circuit, Readout
from annelid.control.circuit_controller import CircuitController, CircuitKind
from annelid.control.network import NetworkController
from annelid.control.network_file import circuit_of_text, circuit_text
from annelid.control.senses import SENSED, Pulse, Sense, Source, Switch, lengthening_m
from annelid.control.sns import DRIVE_HINT, Sns, paper_controller
from annelid.control.turning import TurningController
from annelid.control.user_controller import own_controller
from annelid.lazy import lazy

__all__ = [
    "DRIVE_HINT",
    "SENSED",
    "CallableController",
    "Circuit",
    "CircuitController",
    "CircuitKind",
    "NetworkController",
    "OpenLoopController",
    "OpenLoopKind",
    "Pulse",
    "Readout",
    "SavedWrapper",
    "SegmentController",
    "Sense",
    "Slope",
    "Sns",
    "Source",
    "Switch",
    "TurningController",
    "WrappedController",
    "circuit_of_text",
    "circuit_text",
    "lengthening_m",
    "own_controller",
    "paper_controller",
]
_BUILT = "load_config and build_controller make the CircuitController of a configuration"
_PATTERN = "a section of annelid.config has the pattern (activation), and OpenLoopController follows it"
__getattr__, __dir__ = lazy(
    __name__,
    {
        "SnsController": _BUILT,
        "AdaptiveController": _BUILT,
        **dict.fromkeys(("SineController", "TimedController", "ProgramController"), _PATTERN),
        "StretchSensor": "a Switch of a Circuit is a sensor with threshold and hysteresis",
        "Coded": "a Circuit is written as C by annelid_lab.firmware",
        "ControllerCode": "a Circuit is written as C by annelid_lab.firmware",
    },
    ("annelid_studies.oscillators",),
)
