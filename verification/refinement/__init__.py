"""Cells and increments that are chosen by the rock."""
