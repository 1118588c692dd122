"""What goes elsewhere: runs as tables, pictures, pages and models."""

from annelid.export.formats import FORMATS, SELECTION, Format
from annelid.export.tables import Progress, Selection, about, selected, signal_names
from annelid.lazy import moved

__all__ = [
    "FORMATS",
    "SELECTION",
    "Format",
    "Progress",
    "Selection",
    "about",
    "selected",
    "signal_names",
]
__getattr__ = moved(__name__, "annelid_lab.firmware", "annelid_lab.lems")
