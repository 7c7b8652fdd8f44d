"""Invariants of every grid: patch tests, totals, the operator."""
