"""Limit cycles of planar worms: their period, Floquet multipliers and phase response."""
