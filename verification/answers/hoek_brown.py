"""Tunnel in Hoek-Brown rock with pressure inside: plastic radius, stress, closure, pressure of first failure."""

import numpy as np
from matplotlib.figure import Figure

from verification.answers.plastic import TABLES
from verification.cavities.figure import draw
from verification.cavities.hoek_brown import HoekBrownTunnel
from verification.cavities.runs import Run, brittle_groups, brittle_rows, perfect_rows, read_run
from verification.comparisons import closing_row, truncated_row, vanishing
from verification.results import Results
from verification.rows import Row

__all__ = ["TABLES", "answer"]  # The page has the tables of Coulomb rock.

MPA = 1e-6


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study."""
    settings, allowed = results.settings, results.allowed
    runs = {name: read_run(name, variant) for name, variant in results.variants.items()}
    standing = [runs.pop(name) for name in settings["stands"] if name in runs]
    perfect = [run for run in runs.values() if not run.theory.rock.brittle]
    groups = brittle_groups(list(runs.values()))
    rows = [row for run in perfect for row in perfect_rows(run, settings["outer_radii"], allowed)]
    rows += [row for name, some in groups.items() for row in brittle_rows(name, some, settings["outer_radii"], allowed)]
    for run in standing:
        failed = float(run.cavity.volume[run.cavity.failed].sum())
        rows.append(vanishing(f"{run.name}: rock that fails, m3", failed, 0.0))
    if len(ring := [runs[name] for name in settings["onset"] if name in runs]) > 1:
        rows.append(onset_row(ring, allowed["onset"]))
    every = [*runs.values(), *standing]
    states = [run.cavity.state for run in every]
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
