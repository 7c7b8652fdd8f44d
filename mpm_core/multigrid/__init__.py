"""Elastic equilibrium by conjugate gradients with a geometric V-cycle over the grid's own levels."""
