"""Cases that other codes ship, with their published numbers."""
