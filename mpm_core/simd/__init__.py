"""What works side by side: numbers in vector registers, as a type that numba kernels calculate with, and threads."""
