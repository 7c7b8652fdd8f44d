"""Cases that other codes ship: their numbers, the closed form, and ours."""

import numpy as np
from matplotlib.figure import Figure

from verification.kirsch.fields import Rock
from verification.peers.kratos import AS_STATED, CASES, Return, cutoff_multipliers, ours
from verification.plastic.answer import Run, perfect_rows, read_run
from verification.plastic.figure import draw
from verification.results import Results
from verification.rows import Row

MPA = 1e-6
KRATOS = "Kratos, test_mohr_coulomb_with_tension_cutoff.cpp"
GEOS = "GEOS, KirschProblem_base.xml"
ITASCA = "FLAC3D, VerificationProblems/CylinderInMohrCoulomb"


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows of all cases; figure of the holes."""
    rows = return_rows(results.allowed["returned"])
    pressed = results.settings["pressed"]
    for name, printed in pressed.items():
        rows += wall_rows(name, Rock(results[name]), printed, results.allowed["wall"])
    runs = [read_run(name, variant) for name, variant in results.variants.items() if name not in pressed]
    for run in runs:
        rows += hole_rows(run, results)
    return rows, draw(runs, {})


def return_rows(allowed: float) -> list[Row]:
    """Kratos' returns: largest difference of a principal stress."""
    rows = []
    for case in (*CASES, *AS_STATED):
        found, theirs = ours(case), np.asarray(case.returned, float)
        remark, bound = "error: largest difference of the three", allowed
        if why := impossible(case, theirs):
            remark, bound = f"not compared: theirs {why}; ours is {found.round(4).tolist()}", None
        elif case in AS_STATED:
            remark, bound = (
                f"not compared: theirs is that of Poisson's ratio 0; ours is {found.round(4).tolist()}",
                None,
            )
        quantity = f"{KRATOS}: least principal stress from {case.trial}, dilation {case.dilation:g}"
        quantity += f", Poisson {case.poisson_ratio:g}, cut-off {case.cutoff:g}"
        rows.append(Row(quantity, theirs[2], float(found[2]), float(np.abs(found - theirs).max()), bound, remark))
    return rows


def impossible(case: Return, returned: np.ndarray) -> str:
    """Why no plastic flow leads from a trial stress to (3,), empty if some may."""
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


def hole_rows(run: Run, results: Results) -> list[Row]:
    """The hole that FLAC3D is verified with: its printed values beside theory here, then ours beside theory."""
    theory, printed = run.theory, results.settings["printed"]
    interface = -float(theory.stress(np.array([theory.plastic_radius]))[0][0]) * MPA
    rows = [
        Row.relative(f"{run.name}: {what}, {ITASCA} and the closed form here", value, here, results.allowed["printed"])
        for what, value, here in (
            ("R0 / a", printed["radius"], theory.plastic_radius / theory.radius),
            ("radial compression at R0, MPa", printed["interface"], interface),
        )
    ]
    near = np.abs(run.cavity.distance - theory.plastic_radius) < run.cavity.cell
    beside = -float(run.cavity.radial_hoop_third[0, near].mean()) * MPA
    quantity = f"{run.name}: radial compression within a cell of R0, mean, MPa"
    rows.append(Row.relative(quantity, printed["interface"], beside, results.allowed["interface"]))
    return rows + perfect_rows(run, results.settings["outer_radii"], results.allowed)
