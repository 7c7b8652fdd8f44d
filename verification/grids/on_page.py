"""Tables of the study's page."""

from verification.page_tables import Pivot

COLUMNS = "error, share|cells, thousands|processor time, s|rock above strength in coarse cells, share"
RUN = r"(?P<row>{scene}, \w+, [\d.]+ m): (?P<column>{columns})"

TABLES = (
    Pivot("Sphere by grid and finest cell", RUN.format(scene="sphere", columns=COLUMNS), "measured"),
    Pivot("Stope by grid and finest cell", RUN.format(scene="stope", columns=COLUMNS), "measured"),
    Pivot(
        "At equal error, interpolated",
        r"(?P<row>\w+ at [\d.]+ % error, (?:cells, thousands|processor time, s)): (?P<column>\w+)",
        "measured",
    ),
    Pivot(
        "Error as on the regular grid with the same finest cells (difference of the errors, %)",
        r"(?P<column>\w+, \w+), (?P<row>[\d.]+ m): error as on the regular grid, share",
        "error, %",
    ),
)
