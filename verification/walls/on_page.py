"""Tables of the study's page."""

from verification.page_tables import Pivot

TABLES = (
    Pivot(
        "Potency by place of the walls (m3)",
        r"(?P<row>\w+, \d+ cells across, \w+), (?P<column>\w+): potency, m3",
        "measured",
    ),
    Pivot(
        "Spread of potency over the places of one scene (%)",
        r"(?P<row>\w+, \d+ cells across, \w+), (?P<column>\w+): spread of potency over placements",
        "error, %",
    ),
)
