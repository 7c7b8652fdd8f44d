"""Tables of the study's page."""

from verification.page_tables import Pivot

TABLES = (
    Pivot(
        "Errors (% of the far stress, of the closure itself, or of the wall's largest displacement)",
        r"(?P<column>regular|multilevel|fixed|single|biaxial|pressed): "
        r"(?P<row>(?:radial|hoop|shear|closure|displacement).+)",
        "error, %",
    ),
    Pivot(
        "Hoop stress within a cell of the wall, r.m.s. error by cell size (% of its mean)",
        r"(?P<row>\w+): hoop stress within a cell of the wall, h = (?P<column>[\d.]+ m), r.m.s. share",
        "error, %",
    ),
)
