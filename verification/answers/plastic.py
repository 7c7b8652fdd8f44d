"""Tunnel and spherical cavity in Coulomb rock, perfectly plastic and brittle, against their closed forms."""

from matplotlib.figure import Figure

from verification.cavities.figure import draw
from verification.cavities.runs import brittle_groups, brittle_rows, perfect_rows, read_run
from verification.comparisons import closing_row, truncated_row
from verification.page_tables import Pivot
from verification.results import Results
from verification.rows import Row

TABLES = (
    Pivot(
        "Perfectly plastic rock: errors (cells for the radius, else a share)",
        r"(?P<column>perfect_\w+|perfect|exponent|pressure_3|pressure_8): (?P<row>.+)",
        "error",
    ),
    Pivot("Brittle rock", r"(?P<column>brittle, .+?, a/h = \d+): (?P<row>.+)", "measured"),
)


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study."""
    runs = [read_run(name, variant) for name, variant in results.variants.items()]
    outer, allowed = results.settings["outer_radii"], results.allowed
    perfect = [run for run in runs if not run.theory.rock.brittle]
    groups = brittle_groups(runs)
    rows = []
    for run in perfect:
        rows += perfect_rows(run, outer, {} if run.name in results.settings["reported"] else allowed)
    for name, members in groups.items():
        rows += brittle_rows(name, members, outer, allowed)
    states = [run.cavity.state for run in runs]
    rows += [truncated_row("all", states), closing_row("all", states)]
    return rows, draw(perfect, groups)
