"""What the page of the study sets side by side."""

from verification.page_tables import Pivot

TABLES = (
    Pivot(
        "Errors (shares; degrees for the dilation angle)",
        r"(?P<column>unconfined|confined|sandstone|pulled): (?P<row>.+)",
        "error",
    ),
)
