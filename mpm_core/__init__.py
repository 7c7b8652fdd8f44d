"""From geometry to stress: multi-level material point grid, particles, constitutive laws, equilibrium."""

import os

from common.provenance import use_numba_cache

# A waiting OpenMP thread spins for milliseconds by default: beside other work two threads then take several times as
# long as one. One that sleeps at once takes 50 us to wake, as long as a kernel over a small mine. So it spins for about
# 30 us, the time from one kernel to the next. Demo history, s: 20 (at once asleep: 28); two of them at once, each with
# two threads on two cores: 37 each (33; spinning ten times as long: 110).
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
os.environ.setdefault("GOMP_SPINCOUNT", "1000")
use_numba_cache()
