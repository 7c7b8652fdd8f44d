"""Hoek-Brown rock around a tunnel with pressure inside."""
