"""Recorded and synthetic catalogues: QuakeML, statistics, comparison, report."""
