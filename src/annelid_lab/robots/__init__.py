"""Robots that an MJCF file describes whole, as a body of annelid."""
