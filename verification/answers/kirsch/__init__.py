"""Kirsch's hole (paper section 2.3): regular and multi-level grid against the exact field of the boxed plate."""

import numpy as np
from matplotlib.figure import Figure

from verification.answers.kirsch.fields import ANGLES, Rock, order_rows, read_series, wall_rows
from verification.answers.kirsch.figure import draw
from verification.answers.kirsch.lines import line_rows
from verification.comparisons import bounded, mean_square_root, vanishing
from verification.page_tables import Pivot
from verification.results import Results
from verification.rows import Row

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

COMPONENTS = ("radial", "hoop", "shear")
CLEAR_CELLS, OUTER_RADII = 2.0, 4.0  # Stresses are compared from so many cells off the wall to so many radii.


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study."""
    allowed, settings = results.allowed, results.settings
    rocks = {name: Rock(results[name]) for name in results.present(settings["compared"])}
    series = read_series(results)
    rows = []
    for name, rock in rocks.items():
        rows += stress_rows(name, rock, allowed["stress"])
        rows += displacement_rows(name, rock, allowed["closure"], allowed["displacement"])
    for name in results.present(settings["lines"]):
        rows += line_rows(name, rocks.get(name) or Rock(results[name]))
    rows += price_rows(results, rocks) + tolerance_rows(results, rocks)
    rows += order_rows(series, allowed["order"], settings["stress_distance"])
    treatment = results["multilevel"].values["grid"]["cut_cells"]
    rows += wall_rows(series, rocks["multilevel"].hole.cell, treatment, allowed["extrapolated_over_best"])
    return rows, draw(rocks, series, treatment, settings["stress_distance"])


def ring(rock: Rock) -> tuple[float, float]:
    """Distances from the centre between which stresses are compared, m."""
    return rock.hole.radius + CLEAR_CELLS * rock.hole.cell, OUTER_RADII * rock.hole.radius


def stress_rows(name: str, rock: Rock, allowed: float) -> list[Row]:
    """Errors of the stress by component."""
    errors = rock.stress_error(*ring(rock)).tolist()
    return [
        vanishing(f"{name}: {component} stress, a + 2 h to 4 a, r.m.s. share of the far stress", error, allowed)
        for component, error in zip(COMPONENTS, errors, strict=True)
    ]


def displacement_rows(name: str, rock: Rock, closure: float, displacement: float) -> list[Row]:
    """Closure along both axes, and displacement of the wall and of the rock around it at all angles.

    closure, displacement: allowed errors, as shares of the closure itself and of the wall's largest displacement.
    """
    hole = rock.hole
    rows = []
    for axis, ends in (("x", np.array([0.0, np.pi])), ("y", np.array([0.5, 1.5]) * np.pi)):
        exact = -hole.plate.at(hole.radius * np.exp(1j * ends)).polar_displacement(ends)[0].sum()
        found = -(rock.wall_displacement(ends) * np.exp(-1j * ends)).real.sum()
        rows.append(Row.relative(f"{name}: closure of the hole along {axis}, mm", 1e3 * exact, 1e3 * found, closure))
    exact = hole.plate.at(hole.radius * np.exp(1j * ANGLES)).moved
    largest = float(np.abs(exact).max())
    wall = float(mean_square_root(np.abs(rock.wall_displacement(ANGLES) - exact)) / largest)
    around = rock.displacement_error(*ring(rock)) / largest
    share = "r.m.s. share of the wall's largest"
    rows.append(vanishing(f"{name}: displacement of the wall at all angles, {share}", wall, displacement))
    rows.append(vanishing(f"{name}: displacement, a + 2 h to 4 a, {share}", around, displacement))
    return rows


def price_rows(results: Results, rocks: dict[str, Rock]) -> list[Row]:
    """Error, cells and work of the multi-level grid over those of the regular one, for which there is no theory."""
    if "regular" not in rocks:
        return []
    names = ("multilevel", "regular")

    def ratio(what: str, bound: str, both: list[float], remark: str) -> Row:
        return bounded(f"multilevel over regular: {what}", both[0] / both[1], results.allowed[bound], remark)

    errors = [float(mean_square_root(rocks[name].stress_error(*ring(rocks[name]))[:2])) for name in names]
    remark = f"{100 * errors[0]:.3f} and {100 * errors[1]:.3f} %"
    rows = [ratio("r.m.s. error of radial and hoop stress", "error_over_regular", errors, remark)]
    cells: list[float] = [rocks[name].grid.sizes["cell"] for name in names]
    rows.append(ratio("cells", "cells_over_regular", cells, f"{cells[0]} and {cells[1]} cells"))
    iterations = [int(results[name].elastic.attrs["iterations"]) for name in names]
    work = [count * taken for count, taken in zip(cells, iterations, strict=True)]
    remark = f"{iterations[0]} and {iterations[1]} iterations"
    rows.append(ratio("cells times iterations", "work_over_regular", work, remark))
    return rows


def tolerance_rows(results: Results, rocks: dict[str, Rock]) -> list[Row]:
    """Largest unbalanced force, and the change of stress by a tighter tolerance."""
    left = max(float(results[name].elastic.attrs["unbalanced_ratio"]) for name in rocks)
    rows = [vanishing("all: unbalanced force left at most, share of the excavation force", left)]
    if "tight" in results.variants:
        loose, tight = rocks["multilevel"], Rock(results["tight"])
        chosen = loose.between(*ring(loose))
        share = float(
            mean_square_root((loose.polar - tight.polar)[:, chosen].ravel(), np.tile(loose.volume[chosen], 3))
            / loose.hole.far_stress
        )
        tolerances = [results[name].values["solver"]["tolerance"] for name in ("multilevel", "tight")]
        quantity = f"multilevel: change of stress from tolerance {tolerances[0]:g} to {tolerances[1]:g}, r.m.s. share"
        rows.append(vanishing(quantity, share, results.allowed["tolerance"]))
    return rows
