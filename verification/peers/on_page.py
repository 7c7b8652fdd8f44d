"""Tables of the study's page."""

from verification.page_tables import Pivot

TABLES = (
    Pivot(
        "CB-Geo's particle 1600: compression over the closed form, error (%)",
        r"(?P<row>cbgeo_\w+: \w+ compression) at particle 1600, MPa, (?P<column>CB-Geo|ours).+",
        "error, %",
    ),
    Pivot("Slope: iterations of a step", r"(?P<row>slope_\d+): (?P<column>iterations of the step), .+", "measured"),
)
