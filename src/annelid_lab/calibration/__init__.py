"""Identification: a worm's parameters from several measured experiments at once, with intervals.

A study (`study`) names a worm, parameters and experiments. Each kind of experiment (`kinds`) reads its data and says
what the worm would have given. `fit` weighs the residuals, fits, and finds the intervals; `report` shows them.
"""
