"""Tables of the study's page, from its table.csv."""

from verification.page_tables import Columns

TABLES = (
    Columns(
        "Standard deviation by source, and its share of the variance",
        ("scene", "quantity", "source", "mean", "standard_deviation", "share"),
    ),
)
