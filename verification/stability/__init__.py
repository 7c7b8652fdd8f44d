"""Limits of the numerics: one knob at a time is turned to its extremes, and each run is compared with a known truth.

A reduced set runs with the tests. ``snakemake --cores all stability`` runs all of it.
"""
