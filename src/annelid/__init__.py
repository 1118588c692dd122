"""A soft, peristaltic earthworm robot in 3D, driven by a synthetic nervous system."""
