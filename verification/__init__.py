"""Scenes with a known answer. The ordinary stages run them; each row of a table compares one quantity."""
