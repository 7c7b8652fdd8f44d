"""Stages in which rock was too coarse to fail.

The template is "truncated.html.j2".
"""

import xarray as xr

from catalogs.report.evidence import Evidence
from catalogs.report.gallery import Gallery


def section(evidence: Evidence, _: Gallery) -> list[xr.Dataset]:
    """Stages in which rock reached its strength in cells too coarse to fail."""
    return [stage for stage in evidence.stages if stage.attrs["truncated"]]
