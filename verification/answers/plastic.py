"""Tunnel and spherical cavity in rock that fails, perfectly plastic and brittle, against their closed forms.

The rock follows Coulomb's law, or that of Hoek and Brown with pressure inside the tunnel.
"""

import numpy as np
from matplotlib.figure import Figure

from verification.cavities.figure import draw
from verification.cavities.hoek_brown import HoekBrownTunnel
from verification.cavities.runs import Run, brittle_groups, brittle_rows, perfect_rows, read_run
from verification.comparisons import MPA, closing_row, truncated_row, vanishing
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
    """Rows and figure of the study.

    Settings: outer_radii, how far stress is compared; reported, runs without bounds; stands, runs in which no rock may
    fail; onset, runs from which the pressure of first failure is extrapolated.
    """
    settings, allowed = results.settings, results.allowed
    outer = settings["outer_radii"]
    every = {name: read_run(name, variant) for name, variant in results.variants.items()}
    standing = results.present(settings.get("stands", []))
    runs = [run for name, run in every.items() if name not in standing]
    perfect = [run for run in runs if not run.theory.rock.brittle]
    groups = brittle_groups(runs)
    rows = []
    for run in perfect:
        rows += perfect_rows(run, outer, {} if run.name in settings["reported"] else allowed)
    for name, members in groups.items():
        rows += brittle_rows(name, members, outer, allowed)
    for name in standing:
        cavity = every[name].cavity
        rows.append(vanishing(f"{name}: rock that fails, m3", float(cavity.volume[cavity.failed].sum()), 0.0))
    if len(ring := results.present(settings.get("onset", []))) > 1:
        rows.append(onset_row([every[name] for name in ring], allowed["onset"]))
    states = [run.cavity.state for run in every.values()]
    rows += [truncated_row("all", states), closing_row("all", states)]
    return rows, draw(perfect, groups)


def tunnel_of(run: Run) -> HoekBrownTunnel:
    """The closed form of a run in Hoek-Brown rock."""
    assert isinstance(run.theory, HoekBrownTunnel)
    return run.theory


def onset_row(runs: list[Run], allowed: float) -> Row:
    """Pressure at which the wall begins to fail, extrapolated from the plastic radii R of runs, for a = 0.5.

    ln(R / radius) = 2 / mb (w_front^0.5 - w_wall^0.5) is linear in the root of w_wall = mb pressure / sigma_ci + s.
    """
    theory = tunnel_of(runs[0])
    curve = theory.rock.residual
    root = [np.sqrt(curve.mb * tunnel_of(run).inside / curve.sigma_ci + curve.s) for run in runs]
    reach = [np.log(run.cavity.failed_radius / run.theory.radius) for run in runs]
    slope, at_zero = np.polyfit(root, reach, 1)
    found = ((at_zero / slope) ** 2 - curve.s) * curve.sigma_ci / curve.mb
    quantity = "pressure below which the wall fails, from the rings at lower pressures, MPa"
    remark = f"from {', '.join(run.name for run in runs)}"
    return Row.relative(quantity, theory.critical_pressure * MPA, found * MPA, allowed, remark)
