"""Tables of the study's page."""

from verification.page_tables import Pivot

TABLES = (
    Pivot(
        "Adjusted Rand index of clusters (1 is the truth)",
        r"(?P<row>[\w ]+), (?P<column>k-means|single linkage|DBSCAN \d): adjusted Rand index",
        "measured",
    ),
    Pivot(
        "Elongation of clusters, relative error",
        r"(?P<row>[\w ]+), (?P<column>k-means|single linkage|DBSCAN \d): elongation .+",
        "error",
    ),
    Pivot(
        "Share of scattered particles in a cluster with others",
        r"(?P<row>[\w ]+), (?P<column>k-means|single linkage|DBSCAN \d): share of scattered particles .+",
        "measured",
    ),
    Pivot("Processor time (s)", r"time, (?P<column>[^,]+), (?P<row>[\d,]+ particles), s", "measured"),
    Pivot(
        "Families at closeness 0.8, mechanisms turned at random",
        r"families: closeness 0.8, turned by (?P<row>up to \d+ degrees): (?P<column>.+)",
        "measured",
    ),
    Pivot(
        "Events made of cracks one cell thick, over 28 orientations",
        r"(?P<row>regions .+?|families): events of (?P<column>.+)",
        "measured",
    ),
    Pivot(
        "Adjusted Rand index of bodies of one mechanism, mean of sets",
        r"(?P<row>regions .+?): adjusted Rand index of bodies .+ turned by (?P<column>up to \d+ degrees), .+",
        "measured",
    ),
)
