"""Kept forecasts compared with what was recorded.

The template is "forecasts.html.j2".
"""

import json

from catalogs.report.evidence import Evidence
from catalogs.report.gallery import Gallery


def section(evidence: Evidence, _: Gallery) -> list[str]:
    """Sentences that compare kept forecasts with what was recorded; an empty list without scores."""
    return [] if evidence.forecast_scores is None else json.loads(evidence.forecast_scores.attrs["sentences"])
