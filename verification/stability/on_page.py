"""Tables of the study's page, from its table.csv."""

from verification.page_tables import Counts

TABLES = (Counts("How runs end, by the setting that is changed", "knob", "kind"),)
