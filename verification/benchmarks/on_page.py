"""Tables of the study's page, from its table.csv."""

from verification.page_tables import Cross

TABLES = (
    Cross("Wall time (s) by number of cells", ("problem", "code"), "cells", "wall_s"),
    Cross("Largest memory (GB) by number of cells", ("problem", "code"), "cells", "memory_GB"),
    Cross("Closure of the stope (mm) by number of cells", ("problem", "code"), "cells", "closure_mm"),
)
