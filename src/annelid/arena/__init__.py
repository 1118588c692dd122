"""Where the worm crawls: attaches to any body's spec."""
