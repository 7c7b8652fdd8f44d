"""Dependence of failure on the place of walls within their cells."""
