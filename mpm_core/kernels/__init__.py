"""Numba kernels: plain arrays in and out, apart from the classes that own the arrays."""
