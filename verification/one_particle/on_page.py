"""Tables of the study's page."""

from verification.page_tables import Pivot

TABLES = (
    Pivot(
        "Errors (shares; degrees for the dilation angle)",
        r"(?P<column>unconfined|confined|sandstone|pulled): (?P<row>.+)",
        "error",
    ),
)
