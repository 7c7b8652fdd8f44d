"""Tables of the study's page, from its table.csv."""

from verification.page_tables import Columns

TABLES = (
    Columns("Claims and what was found", ("claim", "record", "terms", "quantity", "wanted", "measured", "holds")),
)
