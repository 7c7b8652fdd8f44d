"""Schemes that seek equilibrium, and what they share: convergence and the brittle cascade. A scheme is a file."""
