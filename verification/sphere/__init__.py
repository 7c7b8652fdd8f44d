"""Elastic spheres, empty and filled."""
