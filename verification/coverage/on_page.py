"""Tables of the study's page."""

from verification.page_tables import Pivot

TABLES = (
    Pivot(
        "Share of catalogues with an interval, and share of intervals that hold the truth",
        r"(?P<row>.+): (?P<column>coverage of the 95 % interval|share of catalogues with an interval) \(error: .+\)",
        "measured",
    ),
    Pivot(
        "Share of pairs of one process that are told apart at 5 %",
        r"(?P<row>.+): (?P<column>\w+) of one process said to differ .+",
        "measured",
    ),
)
