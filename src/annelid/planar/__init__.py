"""Planar worms of the literature, with the same face as the 3D one."""
