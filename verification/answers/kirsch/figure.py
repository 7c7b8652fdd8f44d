"""Figure of Kirsch's hole: a ray, maps, all angles of the biaxial case, the wall itself, and convergence."""

import numpy as np
from matplotlib.figure import Figure

from catalogs.figures import style
from verification.answers.kirsch.fields import Point, Rock, extrapolated, order
from verification.comparisons import MPA
from verification.plots import add_circle, plot_cells, plot_convergence, plot_section, plot_series

TREATMENT_COLOURS = {"mean": style.MODELLED, "subdivide": style.BOTH, "whole": "#cc79a7"}
RAY_COLOURS = ("#9ecae1", "#fdae6b", style.MODELLED, style.RECORDED)  # Radial and hoop, the regular grid in light ones.
MAP_RADII = 2.5  # Half the width of the maps in radii.
RAY_RADII = 5.0  # Length of the ray in radii.
MAP_ERROR_LIMIT = 3.0  # End of the colours of errors, %.


def draw(rocks: dict[str, Rock], series: dict[str, list[Point]], treatment: str, distance: float) -> Figure:
    """All panels. treatment: of cut cells in the scene. distance: at which convergence of stress is shown, radii."""
    figure = style.new_figure(height=17.5)
    rays, maps, angles, orders = figure.subfigures(4, 1, height_ratios=[1.0, 1.75, 1.0, 1.05])
    grids = {name: rocks[name] for name in ("regular", "multilevel") if name in rocks}
    stress, error, cells = rays.subplots(1, 3, width_ratios=[1.2, 1.2, 1.0])
    draw_ray(stress, error, grids)
    draw_cells(cells, rocks["multilevel"])
    draw_maps(maps, grids)
    draw_angles(angles.subplots(1, 3), rocks, distance)
    for axes, (name, what) in zip(
        orders.subplots(1, 3),
        {"closure": "closure", "stress": f"stress at r = {distance:g} a", "wall": "wall's hoop stress"}.items(),
        strict=True,
    ):
        draw_order(axes, series, name, what, treatment)
    return figure


def draw_ray(stress, error, grids: dict[str, Rock]) -> None:
    """Radial and hoop stress along x with the exact lines, and their errors."""
    found, errors = {}, {}
    for name, rock in grids.items():
        hole = rock.hole
        beside = (rock.place.real > 0.0) & (np.abs(rock.place.imag) < 0.5 * hole.cell)
        on_ray = np.flatnonzero(beside & (rock.distance < RAY_RADII * hole.radius))
        on_ray = on_ray[np.argsort(rock.distance[on_ray])]
        exact = rock.exact(on_ray).polar_stress(rock.angle[on_ray])
        for component, what in enumerate(("radial", "hoop")):
            values = rock.polar[component, on_ray]
            found[f"{what}, {name}"] = rock.distance[on_ray], values * MPA
            errors[f"{what}, {name}"] = rock.distance[on_ray], 100 * (values - exact[component]) / hole.far_stress
    hole = next(iter(grids.values())).hole
    r = np.linspace(hole.radius, RAY_RADII * hole.radius, 400)
    radial, hoop, _ = hole.plate.at(r + 0.0j).polar_stress(np.zeros_like(r))
    lines = {"radial, exact": (r, radial * MPA), "hoop, exact": (r, hoop * MPA)}
    look = {"marks": ("s", "s", ".", "."), "colours": RAY_COLOURS, "xlabel": "distance from the centre (m)"}
    labels: dict = {"title": "All-round stress along a ray", "ylabel": "stress (MPa)", "legend": "lower right"}
    plot_series(stress, found, lines, **look, **labels)
    stress.set_ylim(bottom=1.4 * hoop.min() * MPA)  # Room for the legend.
    error.axhline(0.0, color="black", linewidth=1.0)
    error.axvspan(hole.radius, hole.radius + 2 * hole.cell, color="0.93", zorder=0)
    labels = {"title": "Error on the same ray", "ylabel": "share of the far stress (%)", "legend": None}
    plot_series(error, errors, **look, **labels)
    error.set_yscale("symlog", linthresh=1.0, linscale=1.2)
    ticks = (-30, -10, -3, -1, -0.5, 0, 0.5, 1, 3, 10)
    error.set_yticks(ticks, [f"{tick:g}" for tick in ticks])


def draw_cells(axes, rock: Rock) -> None:
    """Cells of the multi-level grid near the hole, coloured by level."""
    grid, hole = rock.grid, rock.hole
    size = grid.cell_size.values
    corner = grid.cell_origin.values[:, :2] - [hole.center.real, hole.center.imag]
    reach = 4.5 * hole.radius
    shown = ((corner < reach) & (corner + size[:, None] > -reach)).all(axis=1)
    colours = {"cmap": style.level_colours(int(grid.attrs["levels"])), "edgecolors": "0.35", "linewidths": 0.25}
    plot_cells(axes, corner[shown], size[shown], grid.cell_level.values[shown], **colours)
    add_circle(axes, hole.radius, facecolor="white")
    labels = {"title": f"{len(size):,} cells, {size.max():g} to {size.min():g} m", "xlabel": "x (m)", "ylabel": "y (m)"}
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", **labels)


def draw_maps(panel, grids: dict[str, Rock]) -> None:
    """Maps of hoop and radial stress around the hole: multi-level, exact, and errors of both grids."""
    stress, errors = {}, {}
    for name, rock in reversed(grids.items()):
        reach = MAP_RADII * rock.hole.radius
        near = rock.between(0.0, 2 * reach)
        place = np.stack([rock.place[near].real, rock.place[near].imag], axis=1)
        found, exact = rock.polar[:, near], np.array(rock.exact(near).polar_stress(rock.angle[near]))
        errors[f"error, {name}"] = place, 100 * (found - exact) / rock.hole.far_stress
        if name == "multilevel":
            stress = {name: (place, found * MPA), "exact": (place, exact * MPA)}
    lowest = min(values.min() for _, values in stress.values())
    looks = [{"cmap": "cividis", "vmin": lowest, "vmax": 0.0}] * len(stress)
    looks += [{"cmap": "RdBu_r", "vmin": -MAP_ERROR_LIMIT, "vmax": MAP_ERROR_LIMIT}] * len(errors)
    all_axes = panel.subplots(2, len(looks), sharex=True, sharey=True)
    drawn = []
    for row, (component, name) in zip(all_axes, ((1, "Hoop"), (0, "Radial")), strict=True):
        for axes, (title, (place, values)), look in zip(row, (stress | errors).items(), looks, strict=True):
            drawn.append(plot_section(axes, place, values[component], (-reach, reach), rock.hole.radius, **look))
            add_circle(axes, rock.hole.radius)
            axes.set_title(f"{name}, {title}")
        row[0].set_ylabel("y (m)")
    for axes in all_axes[-1]:
        axes.set_xlabel("x (m)")
    look = {"orientation": "horizontal", "shrink": 0.6, "aspect": 40}
    panel.colorbar(drawn[0], ax=all_axes[:, :2], label="stress (MPa)", **look)
    panel.colorbar(drawn[-1], ax=all_axes[:, 2:], label="share of the far stress (%)", extend="both", **look)


def draw_angles(panels, rocks: dict[str, Rock], distance: float) -> None:
    """Against the angle: hoop stress of the wall, and of the biaxial case stress at a distance (radii) and closure."""
    look = {"xlabel": "angle (degrees)", "xticks": range(-180, 181, 90), "marks": ".", "legend": "upper center"}
    for axes in panels:
        axes.margins(y=0.35)  # Room for the legend.
    fine = np.radians(np.arange(-180.0, 181.0))
    rock, hole = rocks["multilevel"], rocks["multilevel"].hole
    beside, wall = rock.between(0.0, hole.radius + hole.cell), hole.radius * np.exp(1j * fine)
    particles = {"particles within a cell of it": (np.degrees(rock.angle[beside]), rock.polar[1, beside] * MPA)}
    lines = {
        "exact": (np.degrees(fine), hole.plate.at(wall).polar_stress(fine)[1] * MPA),
        "extrapolated": (np.degrees(fine), extrapolated(rock, wall)[1] * MPA),
    }
    plot_series(panels[0], particles, lines, title="Hoop stress of the wall", ylabel="stress (MPa)", **look)
    if "biaxial" not in rocks:
        return
    rock, hole = rocks["biaxial"], rocks["biaxial"].hole
    near = rock.between(distance * hole.radius - 0.5 * hole.cell, distance * hole.radius + 0.5 * hole.cell)
    exact = hole.plate.at(distance * hole.radius * np.exp(1j * fine)).polar_stress(fine)
    names = ("radial", "hoop", "shear")
    plot_series(
        panels[1],
        {name: (np.degrees(rock.angle[near]), rock.polar[i, near] * MPA) for i, name in enumerate(names)},
        {name: (np.degrees(fine), exact[i] * MPA) for i, name in enumerate(names)},
        title=f"Biaxial: stress at r = {distance:g} a",
        ylabel="stress (MPa)",
        **look,
    )
    angle = np.radians(np.arange(-180.0, 181.0, 5.0))
    moved = rock.wall_displacement(angle) * np.exp(-1j * angle)
    exact_moved = hole.plate.at(hole.radius * np.exp(1j * fine)).polar_displacement(fine)
    parts = ("radial, outward", "hoop")
    plot_series(
        panels[2],
        {name: (np.degrees(angle), 1e3 * part) for name, part in zip(parts, (moved.real, moved.imag), strict=True)},
        {name: (np.degrees(fine), 1e3 * part) for name, part in zip(parts, exact_moved, strict=True)},
        title="Biaxial: displacement of the wall",
        ylabel="displacement (mm)",
        **look,
    )


def draw_order(axes, series: dict[str, list[Point]], name: str, what: str, treatment: str) -> None:
    """One error against cell size by treatment of cut cells, with its order; at the wall that of its extrapolation."""
    lines, colours = {}, []
    for method, points in series.items():
        cells = [point.cell for point in points]
        told = f": order {order(points, name):.2f}" if name != "wall" and len(points) > 1 else ""
        lines[f"{method}{told}"] = cells, [100 * getattr(point, name) for point in points]
        colours.append(TREATMENT_COLOURS.get(method, style.OUTLINE))
        if name == "wall" and method == treatment:
            lines[f"{method}, extrapolated"] = cells, [100 * point.extrapolated for point in points]
            colours.append(style.RECORDED)
    look = {"title": f"Error of the {what}", "xlabel": "finest cell h (m)", "ylabel": "r.m.s. share (%)"}
    plot_convergence(axes, lines, 1.0, colours=colours, **look)
