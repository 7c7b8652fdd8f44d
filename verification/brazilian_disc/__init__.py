"""The Brazilian disc in plane strain: crack, peak load, events."""
