"""A single cell pressed or pulled along z through failure (paper, Fig. 13), against the hand calculation."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from verification.answers.one_particle.closed_form import Axial, Point, Specimen
from verification.answers.one_particle.figure import draw
from verification.answers.one_particle.path import Path
from verification.page_tables import Pivot
from verification.results import Results, Variant
from verification.rows import Row

TABLES = (
    Pivot(
        "Errors (shares; degrees for the dilation angle)",
        r"(?P<column>unconfined|confined|sandstone|pulled): (?P<row>.+)",
        "error",
    ),
)


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
    rows.append(
        Row.relative(
            f"{name}: axial stress after the brittle drop, at rest, MPa",
            failed.stress.axial / 1e6,
            past.stress.axial / 1e6,
            value,
        )
    )
    strength, worst = last.stress.axial, max(flowing, key=lambda point: abs(point.stress.axial - last.stress.axial))
    rows.append(
        Row.relative(f"{name}: axial stress in residual flow, MPa", strength / 1e6, worst.stress.axial / 1e6, value)
    )
    for kind in ("overshoot", "seismic", "later"):
        exact, found = getattr(failed, kind), getattr(past, kind)
        rows.append(
            Row(
                f"{name}: {kind} strain of the failing step, scalar",
                exact.scalar,
                found.scalar,
                (found - exact).scalar / exact.scalar,
                value,
                "error of the tensor",
            )
        )
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
    return [
        Row(
            f"{name}: number of the step of first and only failure",
            1.0,
            float(np.dot(failures, range(len(failures)))),
            0.0 if failures == [False, True, False, False] else 1.0,
            0.0,
        ),
        Row.relative(f"{name}: axial strain at peak, between two steps", strain, middle, allowed["bracket"]),
        Row.relative(
            f"{name}: axial stress at peak, between two steps, MPa",
            stress / 1e6,
            (modulus * middle - specimen.pressure) / 1e6,
            allowed["bracket"],
        ),
    ]


def flow_rows(name: str, path: Path, allowed: dict[str, float]) -> list[Row]:
    """Dilation in the last step, which is residual flow alone."""
    exact, found = path.exact[-1].later, path.found[-1].later
    if path.pulled:  # a crack that opens: only the axial strain is plastic
        return [
            Row.relative(f"{name}: axial plastic strain in residual flow", exact.axial, found.axial, allowed["value"]),
            Row(
                f"{name}: lateral plastic strain in residual flow, share of axial",
                0.0,
                found.lateral / found.axial,
                abs(found.lateral / found.axial),
                allowed["value"],
            ),
        ]
    expected = dilation_angle(exact)
    obtained = dilation_angle(found)
    return [
        Row.relative(
            f"{name}: volumetric over axial plastic strain in residual flow",
            exact.volumetric / exact.axial,
            found.volumetric / found.axial,
            allowed["value"],
        ),
        Row(
            f"{name}: dilation angle in residual flow, degrees",
            expected,
            obtained,
            abs(obtained - expected),
            allowed["angle"],
        ),
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
        Row(f"{name}: potency of other steps, m3", 0.0, others, abs(others), 0.0),
    ]
