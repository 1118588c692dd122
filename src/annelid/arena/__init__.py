"""Where the worm crawls: attaches to any body's spec.

A kind of ground (`kinds`) says where its surface lies; what touches it, and what is seen of it, follows from that. The
names below are what a kind of your own is written with; they are loaded on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from annelid.lazy import lazy

if TYPE_CHECKING:
    from annelid.arena.kinds.floor import Floor, Ground
    from annelid.arena.mjcf import ROBOT, names_in, stated_in, validator, with_attributes
    from annelid.arena.mjcf_files import read_mjcf
    from annelid.arena.surface import Implicit, Level, Plane, Surface

__all__ = [
    "ROBOT",
    "Floor",
    "Ground",
    "Implicit",
    "Level",
    "Plane",
    "Surface",
    "names_in",
    "read_mjcf",
    "stated_in",
    "validator",
    "with_attributes",
]
__getattr__, __dir__ = lazy(__name__, gone={"Nearest": "use Surface"})
