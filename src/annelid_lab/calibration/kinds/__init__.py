"""Kinds of experiments, one in each module."""
