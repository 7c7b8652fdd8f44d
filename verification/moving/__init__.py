"""Particles that move through the grid beside particles that rest."""
