"""What the page of the study sets side by side."""

from verification.page_tables import Pivot

TABLES = (
    Pivot(
        "Rock above strength in coarse cells (share; none is allowed)",
        r"(?P<row>\w+): (?P<column>rock above strength in coarse cells), share",
        "measured",
    ),
)
