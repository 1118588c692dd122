"""A worm to look at in a browser while it runs, or as it was recorded; to change and to poke."""
