"""From a run to numbers: rhythm, elongation, forces, travel."""
