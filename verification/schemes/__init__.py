"""Both schemes on the same mine."""
