"""Tables of the study's page, from its table.csv."""

from verification.page_tables import Columns

TABLES = (
    Columns(
        "Each run beside its scene's base", ("scene", "changes", "times_as_fast", "memory_MiB", "cells", "pareto_front")
    ),
)
