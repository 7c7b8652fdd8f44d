"""What kept forecasts said, and what was recorded.

The template is "forecasts.html.j2".
"""

import json

from catalogs.report.evidence import Evidence
from catalogs.report.gallery import Gallery


def section(evidence: Evidence, _: Gallery) -> list[str]:
    """What kept forecasts said, beside what was recorded, in sentences."""
    return [] if evidence.forecast_scores is None else json.loads(evidence.forecast_scores.attrs["sentences"])
