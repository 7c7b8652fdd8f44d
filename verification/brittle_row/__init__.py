"""A brittle row of cells."""
