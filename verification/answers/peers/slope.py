"""Beremi's slope: the factor of strength above which it finds no equilibrium, and the iterations that it takes.

Facts from Beremi/slope_stability_petsc4py (commit ce5abae): benchmarks/run_2D_homo_SSR_capture/report.md (factors,
Newton steps and seconds of its PETSc run) and case.toml (triangles of 1 m with six nodes, Davis' approach B),
meshes/2d_homo_slope (strength, moduli, weight, boundary), src/slope_stability/constitutive/reduction.py.
"""

from verification.answers.peers.log_spiral import Slope
from verification.results import Results, Variant
from verification.rows import Row

SOURCE = "Beremi, run_2D_homo_SSR_capture"


def rests(variant: Variant) -> bool:
    """Whether the slope has reached equilibrium under its whole weight."""
    return not variant.step(variant.step_names[-1]).attrs["collapsed"]


def limits(results: Results) -> tuple[float, float]:
    """Largest factor with an equilibrium below the smallest without one, and that smallest factor (inf if none)."""
    factors = results.settings["slope"]["factors"]
    by_rest = {True: [], False: [float("inf")]}
    for name, factor in factors.items():
        if name in results.variants:
            by_rest[rests(results[name])].append(factor)
    falls = min(by_rest[False])
    return max((factor for factor in by_rest[True] if factor < falls), default=0.0), falls


def slope_rows(results: Results) -> list[Row]:
    """The limit against the log spiral's and theirs, and iterations against their Newton steps."""
    settings = results.settings["slope"]
    bound, (stands, falls) = Slope(**settings["rock"]).limit(), limits(results)
    theirs = settings["limit"]
    above = f"{100.0 * (theirs / bound - 1.0):.1f} %"
    rows = [
        Row.relative(f"slope: factor at its limit, {SOURCE} and the log spiral", bound, theirs, None,
                     f"{above} above a bound that no exact limit is above; {settings['seconds']:.1f} s for "
                     "14 factors in 8 processes"),
        Row.relative("slope: largest factor that comes to rest, ours and the log spiral", bound, stands,
                     results.allowed["limit"], f"at {falls:g} it moves by more than a cell, which counts as collapse"),
        Row.relative(f"slope: the same beside theirs, {SOURCE}", theirs, stands, None,
                     f"not compared: theirs is {above} above the log spiral's"),
    ]  # fmt: skip
    rows += [work_row(name, results) for name in settings["factors"] if name in results.variants]
    return rows


def work_row(name: str, results: Results) -> Row:
    """Iterations of one run against the Newton steps of their nearest factor."""
    settings, variant = results.settings["slope"], results[name]
    factor, newton = settings["factors"][name], settings["newton"]
    nearest = min(newton, key=lambda one: abs(one - factor))
    step = variant.step_names[-1]
    iterations, seconds = variant.step(step).attrs["iterations"], variant.seconds(f"steps/{step}")
    took = "" if seconds is None else f" in {seconds:.0f} s"
    remark = f"{'comes to rest' if rests(variant) else 'finds no rest'}{took}; theirs at a factor of {nearest:g}"
    quantity = f"{name}: iterations of the step, and their Newton steps"
    return Row.relative(quantity, newton[nearest], float(iterations), None, remark)
