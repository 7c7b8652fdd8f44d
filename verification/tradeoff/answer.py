"""Stub."""


def answer(results):
    """."""
