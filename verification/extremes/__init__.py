"""Scenes at the extremes, drawn by seed: their outcomes, and relations between scenes that must hold.

A reduced set runs with the tests. `verification.stability` runs the scenes by their seeds; the target `extremes` runs
more of them than the target `stability`.
"""
