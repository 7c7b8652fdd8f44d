"""From plastic strain to seismic events: potency, families, clusters, events, catalogue."""

from pipeline.provenance import use_numba_cache

use_numba_cache()
