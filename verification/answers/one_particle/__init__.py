"""A single cell pressed or pulled along z through failure (paper, Fig. 13), against the hand calculation."""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from catalogs.figures import style
from verification.answers.one_particle.closed_form import Axial, Point, Specimen
from verification.comparisons import MPA, vanishing
from verification.page_tables import Pivot
from verification.plots import plot_series
from verification.results import Results, Variant
from verification.rows import Row

TABLES = (
    Pivot(
        "Errors (shares; degrees for the dilation angle)",
        r"(?P<column>unconfined|confined|sandstone|pulled): (?P<row>.+)",
        "error",
    ),
)

PER_THOUSAND = 1e3


@dataclass(frozen=True)
class Path:
    """One variant: points by hand (`exact`) and of the cell (`found`) after each step, and potency by step, m3."""

    specimen: Specimen
    exact: list[Point]
    found: list[Point]
    potency: list[float]
    volume: float

    @property
    def pulled(self) -> bool:
        """True if the cell is pulled rather than pressed."""
        return self.exact[0].strain.axial > 0


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows of every path, and stress and volume over axial strain."""
    paths = {name: read_path(variant) for name, variant in results.variants.items()}
    rows = [row for name, path in paths.items() for row in path_rows(name, path, results.allowed)]
    return rows, draw(paths)


def read_path(variant: Variant) -> Path:
    """Measured and calculated points of a variant, step by step."""
    values = variant.values
    pressure = -values["insitu_stress"]["constant"].get("xx", 0.0)
    specimen = Specimen.of(values["materials"]["host"], pressure)
    added = {entry["step"]: entry["strain"]["zz"] for entry in values["strains"]}
    axial = np.cumsum([added[name] for name in variant.step_names])
    width = values["domain"]["upper"][0] - values["domain"]["lower"][0]
    found = [read_point(variant.grid, variant.step(name), width) for name in variant.step_names]
    potency = [float(variant.events(name)["potency"].sum()) for name in variant.step_names]
    return Path(specimen, specimen.walk(axial.tolist()), found, potency, width**3)


def read_point(grid: xr.Dataset, state: xr.Dataset, width: float) -> Point:
    """The only particle. Its strain follows from the displacement of the cell's upper corner."""

    def strain(name: str) -> Axial:
        xx, yy, zz, *_ = state[name].values[0]
        return Axial(0.5 * float(xx + yy), float(zz))

    corner = int(grid["node_position"].values.sum(axis=1).argmax())
    x, y, z = state["node_displacement"].values[corner] / width
    xx, yy, zz, *_ = state["stress"].values[0]
    return Point(
        strain=Axial(float(x + y) / 2, float(z)),
        stress=Axial(float(xx + yy) / 2, float(zz)),
        overshoot=strain("overshoot_strain"),
        seismic=strain("seismic_strain"),
        later=strain("later_strain"),
        energy=(state.attrs["energy_dissipated"] - state.attrs["energy_gained"]) / width**3,
        failed=bool(state.attrs["failed_particles"]),
    )


def path_rows(name: str, path: Path, allowed: dict[str, float]) -> list[Row]:
    """All rows of one path: moduli, peak, residual flow, parts of the plastic strain, potency and energy."""
    value = allowed["value"]
    rows = [*elastic_rows(name, path, value), *peak_rows(name, path, allowed)]
    _, failed, _, last = path.exact
    _, past, *flowing = path.found
    drop = f"{name}: axial stress after the brittle drop, at rest, MPa"
    rows.append(Row.relative(drop, failed.stress.axial / 1e6, past.stress.axial / 1e6, value))
    strength, worst = last.stress.axial, max(flowing, key=lambda point: abs(point.stress.axial - last.stress.axial))
    rows.append(
        Row.relative(f"{name}: axial stress in residual flow, MPa", strength / 1e6, worst.stress.axial / 1e6, value)
    )
    for kind in ("overshoot", "seismic", "later"):
        exact, found = getattr(failed, kind), getattr(past, kind)
        quantity = f"{name}: {kind} strain of the failing step, scalar"
        error = (found - exact).scalar / exact.scalar
        rows.append(Row(quantity, exact.scalar, found.scalar, error, value, "error of the tensor"))
    rows += flow_rows(name, path, allowed)
    rows += seismic_rows(name, path, value)
    for step, exact, found in zip(("failing step", "residual flow"), (failed, last), (past, flowing[-1]), strict=True):
        remark = "gained: dilation above friction" if exact.energy < 0 else ""
        rows.append(Row.relative(f"{name}: energy dissipated, {step}, J/m3", exact.energy, found.energy, value, remark))
    return rows


def elastic_rows(name: str, path: Path, value: float) -> list[Row]:
    """Elastic constants from the step before the peak."""
    before, specimen = path.found[0], path.specimen
    modulus = (before.stress.axial + specimen.pressure) / before.strain.axial
    ratio = -before.strain.lateral / before.strain.axial
    return [
        Row.relative(f"{name}: Young's modulus, GPa", specimen.youngs_modulus / 1e9, modulus / 1e9, value),
        Row.relative(f"{name}: Poisson's ratio", specimen.poisson_ratio, ratio, value),
    ]


def peak_rows(name: str, path: Path, allowed: dict[str, float]) -> list[Row]:
    """Step, strain and stress of first failure, which lies between two steps; overshoot strain has a row of its own."""
    specimen = path.specimen
    before, past, *_ = path.found
    failures = [point.failed for point in path.found]
    middle = 0.5 * (before.strain.axial + past.strain.axial)
    modulus = (before.stress.axial + specimen.pressure) / before.strain.axial
    strain = specimen.peak_strain(path.pulled)
    stress = specimen.youngs_modulus * strain - specimen.pressure
    number, right = float(np.dot(failures, range(len(failures)))), failures == [False, True, False, False]
    reached, bound = modulus * middle - specimen.pressure, allowed["bracket"]
    return [
        Row(f"{name}: number of the step of first and only failure", 1.0, number, 0.0 if right else 1.0, 0.0),
        Row.relative(f"{name}: axial strain at peak, between two steps", strain, middle, bound),
        Row.relative(f"{name}: axial stress at peak, between two steps, MPa", stress / 1e6, reached / 1e6, bound),
    ]


def flow_rows(name: str, path: Path, allowed: dict[str, float]) -> list[Row]:
    """Dilation in the last step, which is residual flow alone."""
    exact, found = path.exact[-1].later, path.found[-1].later
    flow = "plastic strain in residual flow"
    if path.pulled:  # a crack that opens: only the axial strain is plastic
        lateral = found.lateral / found.axial
        return [
            Row.relative(f"{name}: axial {flow}", exact.axial, found.axial, allowed["value"]),
            vanishing(f"{name}: lateral {flow}, share of axial", lateral, allowed["value"]),
        ]
    expected, obtained = (one.volumetric / one.axial for one in (exact, found))
    angle, found_angle = (dilation_angle(one) for one in (exact, found))
    quantity = f"{name}: dilation angle in residual flow, degrees"
    return [
        Row.relative(f"{name}: volumetric over axial {flow}", expected, obtained, allowed["value"]),
        Row.absolute(quantity, angle, found_angle, allowed["angle"]),
    ]


def dilation_angle(flow: Axial) -> float:
    """psi in degrees: sin(psi) = e_v / (e_v - 2 e_axial) (Vermeer and de Borst 1984)."""
    return float(np.degrees(np.arcsin(flow.volumetric / (flow.volumetric - 2 * flow.axial))))


def seismic_rows(name: str, path: Path, value: float) -> list[Row]:
    """Seismic share of the failing step's plastic strain, and potency of its event."""

    def share(point: Point) -> float:
        return point.seismic.scalar / (point.overshoot + point.seismic + point.later).scalar

    exact, found = path.exact[1], path.found[1]
    others = sum(potency for number, potency in enumerate(path.potency) if number != 1)
    return [
        Row.relative(f"{name}: seismic share of the failing step's plastic strain", share(exact), share(found), value),
        Row.relative(f"{name}: potency of the event, m3", exact.seismic.scalar * path.volume, path.potency[1], value),
        vanishing(f"{name}: potency of other steps, m3", others, 0.0),
    ]


def draw(paths: dict[str, Path]) -> Figure:
    """Axial less lateral stress over axial strain, compression or tension up, and volume below; a column for each path.

    Stress is axial less lateral, since the drop at constant strain changes the lateral stress as well.
    """
    figure = style.new_figure(height=5.6)
    panels = figure.subplots(2, len(paths), squeeze=False, height_ratios=[2, 1], sharex="col")
    for (upper, lower), (name, path) in zip(panels.T, paths.items(), strict=True):
        draw_path(upper, lower, name, path)
    panels[0, 0].set_ylabel("axial less lateral stress (MPa)")
    panels[1, 0].set_ylabel("expansion (‰ of volume)")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=3)
    figure.supxlabel("axial shortening, pulled: stretching (‰)", fontsize=9.5)
    return figure


def draw_path(upper, lower, name: str, path: Path) -> None:
    """Stress and volume of one path. The lines are elastic loading, the drop at constant strain, and residual flow."""
    sign = 1.0 if path.pulled else -1.0
    failed = next(point for point in path.exact if point.failed)
    assert failed.peak is not None  # a calculated point that fails has both stresses
    assert failed.dropped is not None

    def along(points: list[tuple[float, Axial]]) -> tuple[list[float], list[float]]:
        """Axial strains, per thousand, and axial less lateral stresses, MPa, both positive."""
        strain = [sign * PER_THOUSAND * axial for axial, _ in points]
        return strain, [sign * MPA * (stress.axial - stress.lateral) for _, stress in points]

    peak, at = path.specimen.peak_strain(path.pulled), failed.strain.axial
    rising = [(0.0, Axial(0.0, 0.0)), (peak, Axial(0.0, path.specimen.youngs_modulus * peak)), (at, failed.peak)]
    after = [(at, failed.dropped), *((point.strain.axial, point.stress) for point in path.exact[1:])]
    drop = along([(at, failed.peak), (at, failed.dropped)])
    upper.plot(*drop, color=style.RECORDED, linewidth=3.5, label="brittle drop, seismic")
    found = {"cell at rest, by step": along([(point.strain.axial, point.stress) for point in path.found])}
    (x, y), (more_x, more_y) = along(rising), along(after)
    title = f"{name}, {path.specimen.pressure * MPA:g} MPa around" if path.specimen.pressure else name
    plot_series(upper, found, {"hand calculation": (x + more_x, y + more_y)}, legend=None, title=title)
    upper.set(xlim=(0.0, None), ylim=(0.0, None))

    def volume(points: list[Point]) -> tuple[list[float], list[float]]:
        """Axial and volumetric strains, per thousand."""
        strain = [sign * PER_THOUSAND * point.strain.axial for point in points]
        return strain, [PER_THOUSAND * point.strain.volumetric for point in points]

    x, y = volume(path.exact)
    plot_series(lower, {"found": volume(path.found)}, {"by hand": ([0.0, *x], [0.0, *y])}, legend=None)
    lower.axhline(0.0, color=style.OUTLINE, linewidth=0.5)
