"""Excavations and rock bodies as triangle solids (segments in 2-D), and which cells lie inside. Knows no material.

shapes/, solid_files.py (orientation.py: which way facets look) -> solids.py -> inside.py (winding.py:
point inside; crossing.py: cell crossed by the surface).
"""

from mpm_core.geometry.inside import CROSSED, INSIDE, OUTSIDE, classify_cells, contains, popcount, sample_mask
from mpm_core.geometry.shapes import build_shape
from mpm_core.geometry.solid_files import read_solid
from mpm_core.geometry.solids import Outside, Solid

__all__ = [
    "CROSSED",
    "INSIDE",
    "OUTSIDE",
    "Outside",
    "Solid",
    "build_shape",
    "classify_cells",
    "contains",
    "popcount",
    "read_solid",
    "sample_mask",
]
