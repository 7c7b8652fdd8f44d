"""Errors of each accuracy around openings of any shape and place."""
