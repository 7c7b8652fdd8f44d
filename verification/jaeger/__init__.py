"""Strength of rock with weak planes against their angle."""
