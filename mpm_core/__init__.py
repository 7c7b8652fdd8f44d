"""From geometry to stress: multi-level material point grid, particles, constitutive laws, equilibrium."""

import os

from pipeline.provenance import use_numba_cache

# A waiting OpenMP thread spins by default: beside other work two threads then burn twice the CPU time of one.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
use_numba_cache()
