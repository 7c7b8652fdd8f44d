"""Cells and increments that follow the rock."""
