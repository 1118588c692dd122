"""The 3D worm as a MuJoCo spec, in two formulations."""
