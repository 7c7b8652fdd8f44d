"""Domains that follow from their openings."""
