"""Tables of the study's page."""

from verification.page_tables import Pivot

TABLES = (
    Pivot(
        "Errors (% of the far stress, of the closure itself, or of the wall's largest displacement)",
        r"(?P<column>regular|multilevel|fixed|single|biaxial|pressed): "
        r"(?P<row>(?:radial|hoop|shear|closure|displacement).+)",
        "error, %",
    ),
)
