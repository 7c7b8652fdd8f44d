"""Tables of the study's page."""

from verification.page_tables import Pivot

TABLES = (
    Pivot(
        "Brittle rock: distance of the means of both schemes, in standard errors",
        r"(?P<row>.+), brittle: (?P<column>.+?), means of \d+ runs, .+, apart in standard errors",
        "error",
    ),
    Pivot(
        "Brittle rock: mean difference of pairs (% of the mean)",
        r"(?P<row>.+), brittle: (?P<column>.+?), mean difference of pairs, share of the mean",
        "error, %",
    ),
)
