"""Tables of the study's page."""

from verification.page_tables import Pivot

TABLES = (
    Pivot(
        "Errors (% of the far stress, or of the quantity itself)",
        r"(?P<column>(?:hydrostatic|uniaxial)\w*): (?P<row>.+)",
        "error, %",
    ),
)
