"""A slit on elastic gob."""
