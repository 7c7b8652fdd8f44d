"""Seismic events from plastic strain: potency, events, catalogue."""

from common.provenance import use_numba_cache

use_numba_cache()
