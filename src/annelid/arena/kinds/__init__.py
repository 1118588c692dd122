"""The kinds of ground, a module each."""
