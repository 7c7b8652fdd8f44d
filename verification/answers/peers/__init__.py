"""Cases that other codes ship: their numbers and ours against closed forms."""

import numpy as np
from matplotlib.figure import Figure

from verification.answers.kirsch.fields import Rock
from verification.answers.peers.figure import draw
from verification.answers.peers.kratos import AS_STATED, CASES, Return, cutoff_multipliers, ours
from verification.answers.peers.printed import particle_rows, roof_rows
from verification.answers.peers.slope import slope_rows
from verification.answers.plastic import tunnel_of
from verification.cavities.hoek_brown import HoekBrownTunnel
from verification.cavities.runs import Run, perfect_rows, read_run
from verification.comparisons import MPA
from verification.page_tables import Pivot
from verification.results import Results
from verification.rows import Row

TABLES = (
    Pivot(
        "CB-Geo's particle 1600: compression over the closed form, error (%)",
        r"(?P<row>cbgeo_\w+: \w+ compression) at particle 1600, MPa, (?P<column>CB-Geo|ours).+",
        "error, %",
    ),
    Pivot("Slope: iterations of a step", r"(?P<row>slope_\d+): (?P<column>iterations of the step), .+", "measured"),
)

KRATOS = "Kratos, test_mohr_coulomb_with_tension_cutoff.cpp"
GEOS = "GEOS, KirschProblem_base.xml"
ITASCA = "FLAC3D, VerificationProblems"
LARGEST_DIFFERENCE = "error: largest difference of the three"


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows of all cases; figure of holes, roof and slope."""
    settings, allowed = results.settings, results.allowed
    rows = return_rows(allowed["returned"])
    for name in results.present(settings["pressed"]):
        rows += wall_rows(name, Rock(results[name]), settings["pressed"][name], allowed["wall"])
    for name in results.present(settings["roof"]):
        rows += roof_rows(name, results[name], settings["roof"][name], allowed["digits"])
    if results.present(settings["slope"]["factors"]):
        rows += slope_rows(results)
    apart = {*settings["pressed"], *settings["roof"], *settings["slope"]["factors"]}
    runs = [read_run(name, variant) for name, variant in results.variants.items() if name not in apart]
    for run in runs:
        if run.name in settings["particles"]:
            rows += particle_rows(run, **settings["particles"][run.name], allowed=allowed["point"])
        elif isinstance(run.theory, HoekBrownTunnel):
            rows += hoek_brown_rows(run, settings["hoek_brown"], results)
        else:
            rows += coulomb_rows(run, settings["printed"], results)
    return rows, draw(results, runs)


def return_rows(allowed: float) -> list[Row]:
    """Kratos' returns: largest difference of a principal stress."""
    rows = []
    for case in (*CASES, *AS_STATED):
        found, theirs = ours(case), np.asarray(case.returned, float)
        why = impossible(case, theirs) or ("is that of Poisson's ratio 0" if case in AS_STATED else "")
        remark = f"not compared: theirs {why}; ours is {found.round(4).tolist()}" if why else LARGEST_DIFFERENCE
        bound = None if why else allowed
        quantity = f"{KRATOS}: least principal stress from {case.trial}, dilation {case.dilation:g}"
        quantity += f", Poisson {case.poisson_ratio:g}, cut-off {case.cutoff:g}"
        rows.append(Row(quantity, theirs[2], float(found[2]), float(np.abs(found - theirs).max()), bound, remark))
    return rows


def impossible(case: Return, returned: np.ndarray) -> str:
    """Why no plastic flow leads from a trial stress to `returned` (3,); empty if some flow may."""
    change = float(returned.sum() - sum(case.trial))
    if case.dilation == 0.0 and abs(change) > 1e-6:
        return f"changes the sum of stresses by {change:.3g} without dilation"
    both = returned[0] == returned[1] == case.cutoff and returned[2] < 0.0
    multipliers = cutoff_multipliers(case, returned)
    if both and multipliers < 0.0:
        return f"asks the cut-off's faces to flow by {multipliers:.3g} / E, backwards, which Koiter's rule forbids"
    return ""


def wall_rows(name: str, rock: Rock, printed: list[float], allowed: float) -> list[Row]:
    """Hoop compression of a wall at the ends of its hole along x and y, MPa, beside printed values."""
    ends = rock.hole.radius * np.array([1.0 + 0.0j, 1.0j])
    hoop = -rock.fitted_stress(ends, 2, 15, rock.hole.cell)[1] * MPA
    exact = -rock.hole.plate.at(ends).polar_stress(np.angle(ends))[1] * MPA
    return [
        Row.relative(
            f"{name}: hoop compression of the wall along {axis}, MPa, {GEOS}", wanted, float(found), allowed,
            f"in this box exactly {here:.4g}",
        )
        for axis, wanted, found, here in zip("xy", printed, hoop, exact, strict=True)
    ]  # fmt: skip


def coulomb_rows(run: Run, printed: dict[str, float], results: Results) -> list[Row]:
    """The hole that FLAC3D is verified with: its printed values against theory, then ours against theory."""
    theory = run.theory
    interface = -float(theory.stress(np.array([theory.plastic_radius]))[0][0]) * MPA
    rows = printed_rows(
        f"{ITASCA}/CylinderInMohrCoulomb",
        (
            (f"{run.name}: R0 / a", printed["radius"], theory.plastic_radius / theory.radius),
            (f"{run.name}: radial compression at R0, MPa", printed["interface"], interface),
        ),
        results.allowed["printed"],
    )
    near = np.abs(run.cavity.distance - theory.plastic_radius) < run.cavity.cell
    beside = -float(run.cavity.radial_hoop_third[0, near].mean()) * MPA
    quantity = f"{run.name}: radial compression within a cell of R0, mean, MPa"
    rows.append(Row.relative(quantity, printed["interface"], beside, results.allowed["interface"]))
    return rows + perfect_rows(run, results.settings["outer_radii"], results.allowed)


def hoek_brown_rows(run: Run, printed: dict[str, float], results: Results) -> list[Row]:
    """The hole in Hoek-Brown rock that FLAC3D is verified with."""
    theory = tunnel_of(run)
    rows = printed_rows(
        f"{ITASCA}/CylinderInHoekBrownPAC",
        (
            (f"{run.name}: bpl / b", printed["radius"], theory.plastic_radius / theory.radius),
            (f"{run.name}: critical pressure, MPa", printed["critical_pressure"], theory.critical_pressure * MPA),
        ),
        results.allowed["rounded"],
    )
    return rows + perfect_rows(run, results.settings["outer_radii"], results.allowed)


def printed_rows(source: str, values: tuple[tuple[str, float, float], ...], allowed: float) -> list[Row]:
    """Quantity, printed value, value of the closed form here."""
    return [
        Row.relative(f"{quantity}, {source} and the closed form here", printed, here, allowed)
        for quantity, printed, here in values
    ]
