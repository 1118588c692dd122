"""The commands `experiment ..`: what is done to a worm to learn about it; each module registers its own."""
