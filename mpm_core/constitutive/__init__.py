"""Constitutive laws of rock, one stress or eight at a time: numba kernels that know no grid."""
