"""Scenes at the extremes, drawn by seed: what the mechanics make of them, and relations between scenes that must hold.

A reduced set runs with the tests. `verification.stability` runs them by their seeds: 100 for the target `stability`,
400 for the target `extremes`.
"""
