"""Planar worms of the literature, with the same face as the 3D one."""

from annelid.planar.riddle2022 import Riddle2022Plant

__all__ = ["Riddle2022Plant"]
