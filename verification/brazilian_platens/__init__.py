"""The Brazilian disc in 3-D, between platens."""
