"""Baselines of the model: events from the elastic stress of a mine alone, and how all compare with the record.

The package reads states of elastic rock, catalogues and a comparison. It knows no solver and reads no configuration.
"""
