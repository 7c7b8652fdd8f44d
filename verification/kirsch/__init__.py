"""A hole in an elastic plate."""
