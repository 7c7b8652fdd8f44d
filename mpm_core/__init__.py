"""The mechanics, from geometry to stress: multi-level material point grid, particles, constitutive laws,
equilibrium."""

import os

from common.kernel_cache import use_numba_cache

# A waiting OpenMP thread spins for milliseconds by default, which takes the processor from other processes. To wake one
# that sleeps takes as long as a kernel over a small mine, in a virtual machine several times as long. So it spins for
# some tenths of a millisecond, longer than from one kernel to the next.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
os.environ.setdefault("GOMP_SPINCOUNT", "10000")
use_numba_cache()
