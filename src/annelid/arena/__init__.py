"""Where the worm crawls: attaches to any body's spec.

A kind of ground (`kinds`) says where its surface lies; what touches it, and what is seen of it, follows from that. The
names below are what a kind of your own is written with.
"""

from annelid.arena.kinds.floor import Floor, Ground
from annelid.arena.surface import Implicit, Level, Nearest, Plane, Surface

__all__ = ["Floor", "Ground", "Implicit", "Level", "Nearest", "Plane", "Surface"]
