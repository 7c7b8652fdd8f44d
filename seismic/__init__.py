"""Seismic events from plastic strain: potency, events, catalogue."""

from common.kernel_cache import use_numba_cache

use_numba_cache()
