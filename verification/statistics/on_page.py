"""Tables of the study's page."""

from verification.page_tables import Pivot

TABLES = (
    Pivot(
        "Estimates of b",
        r"(?P<row>b .+?): (?P<column>mean of b|coverage of the 95 % interval|mean stated error of b)(?: .+)?",
        "measured",
    ),
    Pivot("Three steps that lie apart", r"three steps (?P<row>\d+ m apart), (?P<column>.+?)(?: \(.+\))?", "measured"),
)
