"""Scenes with a known answer: run by the ordinary stages, compared with closed forms, reported row by row."""
