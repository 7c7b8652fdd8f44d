"""A single cell through failure."""
