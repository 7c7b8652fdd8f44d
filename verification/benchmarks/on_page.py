"""Tables of the study's page, from its table.csv."""

from verification.benchmarks.measuring import DONE, FAILED, LEFT_OUT, NOT_RUN, STOPPED
from verification.page_tables import Columns, Cross

BESIDE_PEERS = ("problem", ("elastic", "coulomb"))
STEPS = ("problem", ("brittle",))
BY = ("problem", "code")

TABLES = (
    Cross("Wall time (s) by number of cells", BY, "cells", "wall_s", BESIDE_PEERS),
    Cross("Wall time over that of `multigrid`", BY, "cells", "ratio", BESIDE_PEERS),
    Cross("Processor time (s) by number of cells", BY, "cells", "cpu_s", BESIDE_PEERS),
    Cross("Largest memory (GB) by number of cells", BY, "cells", "memory_GB", BESIDE_PEERS),
    Cross("Closure of the stope (mm) by number of cells", BY, "cells", "closure_mm", BESIDE_PEERS),
    Cross(
        "Closure less that of the code that it is compared with, as a share", BY, "cells", "difference", BESIDE_PEERS
    ),
    Columns(
        "A step in brittle rock, on equal cells (`multigrid`) and on cells that follow the rock (`adaptive`)",
        (
            "cell_m",
            "code",
            "cells_at_end",
            "wall_s",
            "cpu_s",
            "memory_GB",
            "ratio",
            "closure_mm",
            "failed_m3",
            "outcome",
        ),
        STEPS,
    ),
    Columns(
        "Sizes that were not solved",
        ("problem", "code", "cells", "outcome", "remark"),
        ("outcome", (STOPPED, NOT_RUN, FAILED, LEFT_OUT)),
    ),
    Columns("Versions", ("code", "version"), ("outcome", (DONE,))),
)
