"""Robots and firmware at the other end of a line, in the loop of a simulation at the pace of the wall clock."""

from annelid_lab.loop.frames import Interface, Role
from annelid_lab.loop.links import Link, SerialLink, UdpLink, open_link
from annelid_lab.loop.loop import Driven, drive
from annelid_lab.loop.peer import Fault, Peer, serve
from annelid_lab.loop.pseudo_robot import PseudoRobot
from annelid_lab.loop.servos import Wiring
from annelid_lab.loop.session import Limits
from annelid_lab.loop.wheels import Wheels

__all__ = [
    "Driven",
    "Fault",
    "Interface",
    "Limits",
    "Link",
    "Peer",
    "PseudoRobot",
    "Role",
    "SerialLink",
    "UdpLink",
    "Wheels",
    "Wiring",
    "drive",
    "open_link",
    "serve",
]
