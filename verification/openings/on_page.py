"""Tables of the study's page."""

from verification.page_tables import Pivot

TABLES = (
    Pivot(
        "Error against the finest cells (%)",
        r"(?P<row>\w+), (?P<column>(?:draft|standard|fine): (?:energy|potency|volume)), (?:J|m3)",
        "change, %",
    ),
    Pivot(
        "Energy of slots against fine cells (%)",
        r"slot, (?P<row>dip \d+), (?P<column>\w+ cells? across): energy, J",
        "change, %",
    ),
)
