"""Scenes at the extremes, drawn by seed: what the mechanics make of them, and relations between scenes that must hold.

A reduced set runs with the tests; all of it by ``snakemake --cores all extremes``.
"""
