"""Constitutive laws of rock, one stress at a time: numba kernels that know no grid."""
