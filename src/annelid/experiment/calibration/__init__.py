"""Calibration of the rod worm: the virtual load frame, the measured one, and the fit of the one to the other."""
