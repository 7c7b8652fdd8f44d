"""Numbers side by side in vector registers, as a type that numba kernels calculate with."""
