"""From a design to runs to numbers: sweeps, searches, calibration, error bars, and the store of runs."""
