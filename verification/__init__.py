"""Scenes with a known answer. The ordinary stages run them; each row of a report compares one quantity."""
