"""Calibration of a mine's uncertain quantities to its record: trials, a surrogate of them, a likelihood, a posterior.

The package knows trials as numbers in tables. It knows no mechanics and reads no configuration.
"""
