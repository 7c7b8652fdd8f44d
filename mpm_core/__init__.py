"""From geometry to stress: multi-level material point grid, particles, constitutive laws, equilibrium."""

import os

from common.provenance import use_numba_cache

# A waiting OpenMP thread spins for milliseconds by default, which takes the processor from other processes. A thread
# that sleeps at once takes as long to wake as a kernel over a small mine. So it spins for about the time from one
# kernel to the next.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
os.environ.setdefault("GOMP_SPINCOUNT", "1000")
use_numba_cache()
