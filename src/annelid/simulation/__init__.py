"""The loop of plant, controller and clock, and the run file it writes."""
