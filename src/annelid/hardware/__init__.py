"""Robots and firmware at the other end of a line, in the loop of a simulation at the pace of the wall clock."""

from annelid.hardware.frames import Interface, Role
from annelid.hardware.links import Link, SerialLink, UdpLink, open_link
from annelid.hardware.loop import Driven, drive
from annelid.hardware.peer import Fault, Peer, serve
from annelid.hardware.pseudo_robot import PseudoRobot, pseudo_robot, serve_terminal
from annelid.hardware.servos import Wiring
from annelid.hardware.session import Limits

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
    "Wiring",
    "drive",
    "open_link",
    "pseudo_robot",
    "serve",
    "serve_terminal",
]
