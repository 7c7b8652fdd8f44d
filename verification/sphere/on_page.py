"""What the page of the study sets side by side."""

from verification.page_tables import Pivot

TABLES = (
    Pivot(
        "Errors (% of the far stress, or of the quantity itself)",
        r"(?P<column>(?:hydrostatic|uniaxial)\w*): (?P<row>.+)",
        "error, %",
    ),
)
