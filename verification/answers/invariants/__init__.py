"""Invariants that hold to round-off on any grid, and second order of convergence for a smooth field."""

import numpy as np
from matplotlib.figure import Figure

from catalogs.figures import style
from common.voigt import NAMES, tensor_from_voigt, voigt_from_tensor
from verification.answers.invariants.closed_form import Column, Elastic
from verification.answers.invariants.operator import (
    Solved,
    fly,
    model_of,
    nodal_mass,
    resultants,
    rigid_motions,
    solve_smooth,
)
from verification.comparisons import convergence_orders, reported, vanishing
from verification.plots import plot_convergence, plot_errors, plot_series
from verification.results import Results, Variant
from verification.rows import Row

MIN_DRAWN_ERROR = 1e-18  # Errors of exactly zero are drawn here.


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows of all variants that were run, and the figure."""
    allowed, settings = results.allowed, results.settings
    judge = {
        "virgin": lambda name, variant: virgin_rows(name, variant, allowed["nothing"]),
        "patch": lambda name, variant: patch_rows(name, variant, allowed["round_off"]),
        "unloading": lambda name, variant: unloading_rows(name, variant, allowed["round_off"]),
        "column": lambda name, variant: column_rows(name, variant, allowed["round_off"]),
        "space": lambda name, variant: space_rows(name, variant, settings, allowed["round_off"]),
    }
    rows = []
    for name, variant in results.variants.items():
        kind = name.split("_")[0]
        if kind in judge:
            rows += judge[kind](name, variant)
    exact = [row for row in rows if row.allowed]
    series = smooth_series(results)
    for kind, solved in series.items():
        rows += order_rows(kind, solved, allowed["order"])
    columns = {
        name: (column_of(variant), *column_profile(variant))
        for name, variant in results.variants.items()
        if name.startswith("column")
    }
    return rows, draw(exact, columns, series)


def smooth_series(results: Results) -> dict[str, list[Solved]]:
    """Solutions of the smooth field on each series of grids that was run, by series and particles in a cell."""
    smooth = results.settings["smooth"]
    series = {}
    for kind, names in smooth["series"].items():
        there = results.present(names)
        for per_edge in smooth["particles_per_edge"][kind] if len(there) > 1 else []:
            count = per_edge ** results[there[0]].mine.dimension
            label = f"{kind}, {count} particle{'s' if count > 1 else ''} per cell"
            series[label] = [solve_smooth(results[name], smooth, per_edge) for name in there]
    return series


def share_rows(name: str, compared: dict[str, tuple], allowed: float, remark: str) -> list[Row]:
    """Rows of the largest error of found and exact values, over the largest exact value. The first has the remark."""
    rows: list[Row] = []
    for what, (found, exact) in compared.items():
        error = float(np.abs(found - exact).max() / np.abs(exact).max())
        quantity = f"{name}: {what}, share of the largest"
        rows.append(vanishing(quantity, error, allowed, "" if rows else remark))
    return rows


def hanging(variant: Variant) -> str:
    """Number of hanging nodes, for a remark."""
    parents = variant.grid["node_parents"].values
    return f"{int((parents[:, 0] >= 0).sum())} of {len(parents)} nodes hang"


def virgin_rows(name: str, variant: Variant, allowed: float) -> list[Row]:
    """Virgin rock: exactly nothing moves, fails or changes its stress."""
    moved = failed = 0.0
    for state in (variant.elastic, *(variant.step(step) for step in variant.step_names)):
        moved = max(moved, float(np.abs(state["node_displacement"].values).max()))
        failed += float((state["failed"].values >= 0).sum())
    insitu = variant.scene().insitu
    last = variant.last
    virgin = insitu.at(last["position"].values[:, 2])
    return [
        vanishing(f"{name}: largest displacement, m", moved, allowed, hanging(variant)),
        vanishing(f"{name}: failed particles", failed, allowed),
        vanishing(
            f"{name}: largest change of stress, Pa", float(np.abs(last["stress"].values - virgin).max()), allowed
        ),
    ]


def tensor(components: dict[str, float]) -> np.ndarray:
    """Symmetric tensor (3, 3) of named components, others zero."""
    return tensor_from_voigt([components.get(name, 0.0) for name in NAMES])


def elastic(variant: Variant, material: str) -> Elastic:
    """Moduli of a material of a variant."""
    values = variant.values["materials"][material]
    return Elastic(values["youngs_modulus"], values["poisson_ratio"])


def patch_rows(name: str, variant: Variant, allowed: float) -> list[Row]:
    """Displacement and stress of a homogeneous strain."""
    strain = tensor(variant.values["strains"][0]["strain"])
    state = variant.elastic
    place = variant.grid["node_position"].values
    stress = np.tile(voigt_from_tensor(elastic(variant, "host").stress(strain)), (state.sizes["particle"], 1))
    compared = {
        "displacement": (state["node_displacement"].values, place @ strain),
        "stress": (state["stress"].values, stress),
    }
    left = f"{name}: unbalanced force, share of what the boundary carries"
    return [
        *share_rows(name, compared, allowed, hanging(variant)),
        vanishing(left, float(state.attrs["unbalanced_ratio"]), allowed),
    ]


def unloading_rows(name: str, variant: Variant, allowed: float) -> list[Row]:
    """A free top loses the virgin traction: the rock rises linearly, and no vertical stress is left."""
    rock, virgin = elastic(variant, "host"), tensor(variant.values["insitu_stress"]["constant"])
    state = variant.elastic
    place = variant.grid["node_position"].values
    exact = np.zeros_like(place)
    exact[:, 2] = -virgin[2, 2] * place[:, 2] / rock.confined_modulus
    change = np.diag([rock.confined_ratio, rock.confined_ratio, 1.0]) * -virgin[2, 2]
    stress = np.tile(voigt_from_tensor(virgin + change), (state.sizes["particle"], 1))
    compared = {
        "displacement": (state["node_displacement"].values, exact),
        "stress": (state["stress"].values, stress),
    }
    return share_rows(name, compared, allowed, f"{hanging(variant)}; {int(state.attrs['iterations'])} steps")


def column_of(variant: Variant) -> Column:
    """The column of a variant; gravity is the vertical gradient of virgin stress over the density of the host."""
    values = variant.values
    materials, pour = values["materials"], values["excavations"][0]
    weight = -values["insitu_stress"]["gradient"]["zz"]
    return Column(
        elastic(variant, "host"),
        elastic(variant, "fill"),
        rock_weight=weight,
        fill_weight=weight * materials["fill"]["density"] / materials["host"]["density"],
        joint=pour["lower"][-1],
        top=pour["upper"][-1],
    )


def column_profile(variant: Variant) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Heights of nodes and their vertical displacement, heights of particles and their vertical stress."""
    state = variant.elastic
    there = state["volume"].values > 0.0
    return (
        variant.grid["node_position"].values[:, 2],
        state["node_displacement"].values[:, 2],
        state["position"].values[there, 2],
        state["stress"].values[there, 2],
    )


def column_rows(name: str, variant: Variant, allowed: float) -> list[Row]:
    """Displacement at nodes, stress at centres of fill and of rock."""
    column, state = column_of(variant), variant.elastic
    place = variant.grid["node_position"].values
    exact = np.zeros_like(place)
    exact[:, 2] = column.displacement(place[:, 2])
    there = state["volume"].values > 0.0
    is_fill = state["excavation"].values >= 0
    height = state["position"].values[:, 2]
    lateral = column.fill.confined_ratio
    fill = column.fill_stress(height[there & is_fill])[:, None] * np.array([lateral, lateral, 1.0])
    ratio = column.rock.confined_ratio
    virgin = variant.scene().insitu.at(height[there & ~is_fill])[:, :3]
    rock = virgin + column.change * np.array([ratio, ratio, 1.0])
    found = state["stress"].values
    compared = {
        "displacement at nodes": (state["node_displacement"].values, exact),
        "stress of the fill at centres": (found[there & is_fill], np.hstack([fill, np.zeros_like(fill)])),
        "stress of the rock at centres": (found[there & ~is_fill], np.hstack([rock, np.zeros_like(rock)])),
    }
    return share_rows(name, compared, allowed, f"{hanging(variant)}; {int(state.attrs['iterations'])} steps")


def space_rows(name: str, variant: Variant, settings: dict, allowed: float) -> list[Row]:
    """Rigid motions, totals of mass, force and moment, and momentum in flight."""
    random = np.random.default_rng(settings["seed"])
    model = model_of(variant)
    remark = hanging(variant)
    rows = [
        vanishing(f"{name}: force of a rigid {motion}, share of stiffness times motion", force, allowed, remark)
        for motion, force in rigid_motions(model, random).items()
    ]
    force, moment = resultants(model, random)
    rows.append(vanishing(f"{name}: resultant of random stress, share of the forces' sum", force, allowed))
    rows.append(vanishing(f"{name}: moment of random stress, share of its terms' sum", moment, allowed))
    particles = model.particles
    density = np.array([material.density for material in model.scene.materials.values()])[model.material]
    carried = density * model.volumes(model.step)
    center = (carried[:, None] * particles.position).sum(axis=0) / carried.sum()
    mass, nodal_center = nodal_mass(model)
    quantity = f"{name}: mass at the nodes, rho V of what bears, kg"
    rows.append(Row.relative(quantity, float(carried.sum()), mass, allowed))
    off = float(np.abs(nodal_center - center).max() / (model.grid.shape.max() * model.grid.fine_cell))
    rows.append(vanishing(f"{name}: centre of the mass at the nodes, share of the width", off, allowed))
    flight = fly(variant, random, settings["moving_steps"], settings["moving_reach"])
    remark = f"{flight.cell_changes} changes of cell in {settings['moving_steps']} steps"
    quantity = f"{name}: momentum of moving particles, drift as share of the sum of sizes"
    rows.append(vanishing(quantity, flight.momentum, allowed, remark))
    rows.append(vanishing(f"{name}: mass at the nodes while particles move, drift", flight.mass, allowed))
    return rows


def order_rows(kind: str, solved: list[Solved], least: float) -> list[Row]:
    """Rows of the least order of convergence of all halvings. Stress has no bound."""
    rows = []
    for quantity, required in (("displacement", least), ("stress", None)):
        errors = [getattr(one, quantity) for one in solved]
        orders = convergence_orders([one.cell for one in solved], errors)
        worst = min(orders)
        remark = (
            f"L2 errors {', '.join(f'{error:.2e}' for error in errors)}; by halving "
            f"{', '.join(f'{order:.2f}' for order in orders)}; {solved[-1].cells} cells at last"
        )
        cells = f"finest cells {solved[0].cell:g} to {solved[-1].cell:g} m"
        quantity = f"{kind}: order of convergence of {quantity}, least of all halvings, {cells}"
        rows.append(
            reported(quantity, worst, remark) if required is None else Row.at_least(quantity, worst, required, remark)
        )
    return rows


def draw(rows: list[Row], columns: dict[str, tuple], series: dict[str, list[Solved]]) -> Figure:
    """Errors against round-off, the column, and errors against cell size.

    rows: those with an allowed error. columns: closed form and profile by variant. series: solutions by kind.
    """
    figure = style.new_figure(height=4.8)
    left, middle, right = figure.subplots(1, 3)
    kinds = list(dict.fromkeys(row.quantity.split("_")[0] for row in rows))
    errors: dict[str, list] = {
        variant: [
            [max(row.error, MIN_DRAWN_ERROR) for row in rows if row.quantity.startswith(f"{kind}_{variant}")]
            for kind in kinds
        ]
        for variant in ("section", "block")
    }
    errors["allowed"] = [next(row.allowed for row in rows if row.quantity.startswith(kind)) for kind in kinds]
    what = "error, share of the largest term (0: 1e-18)\ncircles: section, squares: block, bars: allowed"
    plot_errors(left, kinds, errors, marks="os|", legend=None, xscale="log", title="Round-off", xlabel=what)
    found = {f"nodes, {name.split('_')[1]}": (1e3 * moved, nodes) for name, (_, nodes, moved, *_) in columns.items()}
    exact = {}
    if columns:
        column = next(iter(columns.values()))[0]
        z = np.linspace(0.0, column.top, 200)
        exact = {"closed form": (1e3 * column.displacement(z), z)}
        middle.axhline(column.joint, color=style.OUTLINE, linewidth=0.6, linestyle=":")
        for name, side in (("fill", "bottom"), ("rock", "top")):
            middle.annotate(name, (0.03, column.joint), xycoords=("axes fraction", "data"), va=side)
    labels: dict = {"xlabel": "vertical displacement (mm)", "ylabel": "height (m)", "title": "Column under its weight"}
    plot_series(middle, found, exact, marks=("o", "s"), **labels)
    lines = {}
    for kind, solved in series.items():
        cells = [one.cell for one in solved]
        lines[f"displacement, {kind}"] = cells, [one.displacement for one in solved]
        lines[f"stress, {kind}"] = cells, [one.stress for one in solved]
    marks = [f"{mark}{line}" for mark in "osD^" for line in ("-", ":")]
    labels = {"xlabel": "finest cell (m)", "ylabel": "L2 error, share of the field", "title": "Smooth field"}
    plot_convergence(right, lines, 2.0, "h²", marks=marks, **labels)
    right.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=7.5)
    return figure
