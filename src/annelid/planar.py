"""Planar worms lie in `annelid_studies.planar` now; this name goes with the next release."""

from annelid.lazy import moved

__getattr__ = moved(__name__, "annelid_studies.planar")
