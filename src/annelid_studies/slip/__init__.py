"""Slip: what pressure feedback saves, and how well a robot can tell that it slips."""
