"""Tunnels and cavities in plastic and in brittle rock."""
