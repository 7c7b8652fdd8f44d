"""What every stage shares: one-line errors, atomic datasets, provenance, and the body of a command line."""
