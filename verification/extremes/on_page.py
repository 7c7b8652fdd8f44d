"""What the page of the study shows of its table.csv."""

from verification.page_tables import Counts

TABLES = (Counts("How random mines end", "series", "kind"),)
