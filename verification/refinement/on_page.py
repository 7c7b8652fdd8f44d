"""Tables of the study's page."""

from verification.page_tables import Pivot

TABLES = (
    Pivot(
        "Rock above strength in coarse cells (share; none is allowed)",
        r"(?P<row>\w+): (?P<column>rock above strength in coarse cells), share",
        "measured",
    ),
)
