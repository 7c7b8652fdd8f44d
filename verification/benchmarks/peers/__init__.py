"""Scripts that run in the environments of other codes, and what they share."""
