"""Cases that other codes ship, with their numbers."""
