"""Tables of the study's page."""

from verification.page_tables import Pivot

TABLES = (
    Pivot(
        "Perfectly plastic rock: errors (cells for the radius, else a share)",
        r"(?P<column>perfect_\w+|perfect|exponent|pressure_3|pressure_8): (?P<row>.+)",
        "error",
    ),
    Pivot("Brittle rock", r"(?P<column>brittle, .+?, a/h = \d+): (?P<row>.+)", "measured"),
)
