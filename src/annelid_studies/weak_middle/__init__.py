"""Why the middle of the worm is weak: every segment pulled alone, over body, ground and kind of actuator."""
