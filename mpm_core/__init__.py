"""From geometry to stress: multi-level material point grid, particles, constitutive laws, equilibrium."""

from pipeline.provenance import use_numba_cache

use_numba_cache()
