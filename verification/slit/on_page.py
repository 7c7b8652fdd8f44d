"""Tables of the study's page."""

from verification.page_tables import Pivot

TABLES = (
    Pivot("Error against the slit (%)", r"(?P<row>(?:level|stiff|thin)_\w+): (?P<column>[^,]+), (?:m2|mm)", "error, %"),
    Pivot(
        "Error of a dipping opening against a level one (%)",
        r"(?P<row>dip_\w+): (?P<column>closed area)[^,]*, m2",
        "error, %",
    ),
)
