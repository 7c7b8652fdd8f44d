"""From plastic strain to seismic events: potency, events, catalogue."""

from common.provenance import use_numba_cache

use_numba_cache()
