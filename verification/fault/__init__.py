"""A stope beside a fault."""
