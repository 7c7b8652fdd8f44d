"""Figure of Kirsch's hole: a ray, maps, all angles of the biaxial case, the wall itself, and convergence."""

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from scipy.spatial import cKDTree

from catalogs.figures import style
from verification.answers.kirsch.hole_fields import Rock
from verification.answers.kirsch.series import Point, extrapolated, order

MPA = 1e-6
TREATMENT_COLOURS = {"whole": "#cc79a7", "mean": style.MODELLED, "subdivide": style.BOTH}
GRID_COLOURS = {"regular": style.BEFORE_RECORD, "multilevel": style.MODELLED}
HOOP, RADIAL, SHEAR = style.RECORDED, style.MODELLED, style.BOTH
MAP_RADII = 2.5  # Half the width of the maps in radii.
MAP_ERROR_LIMIT = 3.0  # End of the colours of errors, %.
MAP_PIXELS = 200  # Pixels along a side of a map.


def draw(rocks: dict[str, Rock], series: dict[str, list[Point]], treatment: str, distance: float) -> Figure:
    """All panels. treatment: of cut cells in the scene. distance: at which convergence of stress is shown, radii."""
    figure = style.new_figure(height=17.5)
    rays, maps, angles, orders = figure.subfigures(4, 1, height_ratios=[1.0, 1.75, 1.0, 1.05])
    grids: dict[str, Rock] = {name: rocks[name] for name in ("regular", "multilevel") if name in rocks}
    stress, error, cells = rays.subplots(1, 3, width_ratios=[1.2, 1.2, 1.0])
    draw_ray(stress, error, grids)
    draw_cells(cells, rocks["multilevel"])
    draw_maps(maps, grids)
    wall, around, moved = angles.subplots(1, 3)
    draw_wall(wall, rocks["multilevel"])
    if "biaxial" in rocks:
        draw_angles(around, rocks["biaxial"], distance)
        draw_displacement(moved, rocks["biaxial"])
    closure, away, near = orders.subplots(1, 3)
    draw_order(closure, series, "closure", "closure")
    draw_order(away, series, "stress", f"stress at r = {distance:g} a")
    draw_wall_errors(near, series, treatment)
    return figure


def draw_ray(stress, error, grids: dict[str, Rock]) -> None:
    """Radial and hoop stress along x with the exact lines, and their errors."""
    for name, rock in grids.items():
        hole = rock.hole
        on_ray = np.flatnonzero(
            (rock.place.real > 0.0) & (np.abs(rock.place.imag) < 0.5 * hole.cell) & (rock.distance < 5.0 * hole.radius)
        )
        on_ray = on_ray[np.argsort(rock.distance[on_ray])]
        r = rock.distance[on_ray]
        exact = rock.exact(on_ray).polar_stress(rock.angle[on_ray])
        small = name == "multilevel"
        look = {"marker": "o", "linestyle": "none", "markersize": 3.0 if small else 6.0, "zorder": 3 if small else 2}
        look["rasterized"] = True
        for component, colour in ((0, RADIAL), (1, HOOP)):
            found = rock.polar[component, on_ray]
            face = colour if small else "none"
            label = f"{('radial', 'hoop')[component]}, {name}"
            stress.plot(r, found * MPA, color=colour, markerfacecolor=face, markeredgewidth=0.7, label=label, **look)
            share = 100 * (found - exact[component]) / hole.far_stress
            error.plot(r, share, color=colour, markerfacecolor=face, markeredgewidth=0.7, **look)
    hole = next(iter(grids.values())).hole
    r = np.linspace(hole.radius, 5.0 * hole.radius, 400)
    exact = hole.plate.at(r + 0.0j).polar_stress(np.zeros_like(r))
    for component in (0, 1):
        stress.plot(r, exact[component] * MPA, color="black", linewidth=1.0, zorder=4, label=("exact", None)[component])
    stress.set(title="All-round stress along a ray", xlabel="distance from the centre (m)", ylabel="stress (MPa)")
    stress.legend(loc="upper right", bbox_to_anchor=(1.0, 0.45), ncols=1, fontsize=8)
    error.axhline(0.0, color="black", linewidth=1.0)
    error.axvspan(hole.radius, hole.radius + 2 * hole.cell, color="0.93", zorder=0)
    error.set(
        title="Error on the same ray", xlabel="distance from the centre (m)", ylabel="share of the far stress (%)"
    )
    error.set_yscale("symlog", linthresh=1.0, linscale=1.2)
    error.set_yticks(
        [-30, -10, -3, -1, -0.5, 0, 0.5, 1, 3, 10], ["-30", "-10", "-3", "-1", "-0.5", "0", "0.5", "1", "3", "10"]
    )


def draw_cells(axes, rock: Rock) -> None:
    """Cells of the multi-level grid near the hole, coloured by level."""
    grid, hole = rock.grid, rock.hole
    size = grid.cell_size.values
    corner = grid.cell_origin.values[:, :2] - [hole.center.real, hole.center.imag]
    reach = 4.5 * hole.radius
    shown = np.flatnonzero(((corner < reach) & (corner + size[:, None] > -reach)).all(axis=1))
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    drawn = PolyCollection(
        corner[shown, None] + size[shown, None, None] * square,
        array=grid.cell_level.values[shown],
        cmap=style.level_colours(int(grid.attrs["levels"])),
        edgecolors="0.35",
        linewidths=0.25,
        rasterized=True,
    )
    axes.add_collection(drawn)
    axes.add_patch(Circle((0.0, 0.0), hole.radius, facecolor="white", edgecolor=style.OUTLINE))
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xlabel="x (m)", ylabel="y (m)")
    axes.set_title(f"{len(size):,} cells, {size.max():g} to {size.min():g} m")


def draw_maps(panel, grids: dict[str, Rock]) -> None:
    """Maps of hoop and radial stress around the hole: multi-level, exact, and errors of both grids."""
    rock = grids["multilevel"]
    hole = rock.hole
    reach = MAP_RADII * hole.radius
    axis = (np.arange(MAP_PIXELS) + 0.5) / MAP_PIXELS * 2 * reach - reach
    points = axis[None, :] + 1j * axis[:, None]
    inside = np.abs(points) < hole.radius
    exact = np.zeros((3, *points.shape))
    exact[:, ~inside] = hole.plate.at(points[~inside]).polar_stress(np.angle(points[~inside]))
    columns = [("multilevel", read_map(rock, rock.polar, points) * MPA), ("exact", exact * MPA)]
    for name, other in reversed(grids.items()):
        # The exact stress is that at the particle, not at the pixel.
        error = other.polar.copy()
        near = other.between(0.0, 2 * reach)
        error[:, near] -= other.exact(near).polar_stress(other.angle[near])
        columns.append((f"error, {name}", 100 * read_map(other, error, points) / hole.far_stress))
    all_axes = panel.subplots(2, len(columns), sharex=True, sharey=True)
    looks = [{"cmap": "cividis", "vmin": exact.min() * MPA, "vmax": 0.0}] * 2
    looks += [{"cmap": "RdBu_r", "vmin": -MAP_ERROR_LIMIT, "vmax": MAP_ERROR_LIMIT}] * (len(columns) - 2)
    extent = (-reach, reach, -reach, reach)
    drawn = []
    for row, (component, name) in zip(all_axes, ((1, "Hoop"), (0, "Radial")), strict=True):
        for axes, (title, images), look in zip(row, columns, looks, strict=True):
            image = np.where(inside, np.nan, images[component])
            drawn.append(axes.imshow(image, origin="lower", extent=extent, interpolation="nearest", **look))
            axes.add_patch(Circle((0.0, 0.0), hole.radius, facecolor="none", edgecolor=style.OUTLINE, linewidth=0.8))
            axes.set_title(f"{name}, {title}")
        row[0].set_ylabel("y (m)")
    for axes in all_axes[-1]:
        axes.set_xlabel("x (m)")
    look = {"orientation": "horizontal", "shrink": 0.6, "aspect": 40}
    panel.colorbar(drawn[0], ax=all_axes[:, :2], label="stress (MPa)", **look)
    panel.colorbar(drawn[-1], ax=all_axes[:, 2:], label="share of the far stress (%)", extend="both", **look)


def read_map(rock: Rock, values: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Values (component, *points) of the particle nearest to each point. values: (component, particle)."""
    tree = cKDTree(np.stack([rock.place.real, rock.place.imag], axis=1))
    return values[:, tree.query(np.stack([points.real, points.imag], axis=-1))[1]]


def draw_wall(axes, rock: Rock) -> None:
    """Hoop stress within a cell of the wall, and extrapolated to the wall, against the angle."""
    hole = rock.hole
    beside = rock.between(0.0, hole.radius + hole.cell)
    axes.plot(
        np.degrees(rock.angle[beside]),
        rock.polar[1, beside] * MPA,
        ".",
        color=style.BEFORE_RECORD,
        markersize=3,
        rasterized=True,
        label="particles within a cell of it",
    )
    angle = np.radians(np.arange(-180.0, 181.0, 2.0))
    wall = hole.radius * np.exp(1j * angle)
    axes.plot(np.degrees(angle), extrapolated(rock, wall)[1] * MPA, color=HOOP, label="extrapolated")
    axes.plot(
        np.degrees(angle), hole.plate.at(wall).polar_stress(angle)[1] * MPA, color="black", linewidth=1.0, label="exact"
    )
    axes.margins(y=0.2)
    axes.set(title="Hoop stress of the wall", xlabel="angle (degrees)", ylabel="stress (MPa)")
    axes.set_xticks(range(-180, 181, 90))
    axes.legend()


def draw_angles(axes, rock: Rock, distance: float) -> None:
    """Biaxial stress at a distance (radii) against the angle."""
    hole = rock.hole
    near = rock.between(distance * hole.radius - 0.5 * hole.cell, distance * hole.radius + 0.5 * hole.cell)
    angle = np.radians(np.arange(-180.0, 181.0))
    exact = hole.plate.at(distance * hole.radius * np.exp(1j * angle)).polar_stress(angle)
    for component, (colour, name) in enumerate(((RADIAL, "radial"), (HOOP, "hoop"), (SHEAR, "shear"))):
        found = rock.polar[component, near] * MPA
        axes.plot(np.degrees(rock.angle[near]), found, ".", color=colour, markersize=3, rasterized=True, label=name)
        axes.plot(np.degrees(angle), exact[component] * MPA, color="black", linewidth=1.0)
    axes.set(title=f"Biaxial: stress at r = {distance:g} a", xlabel="angle (degrees)", ylabel="stress (MPa)")
    axes.set_xticks(range(-180, 181, 90))
    axes.set_ylim(top=16.0)
    axes.legend(markerscale=3, ncols=3, loc="upper center")


def draw_displacement(axes, rock: Rock) -> None:
    """Biaxial displacement of the wall against the angle."""
    hole = rock.hole
    angle = np.radians(np.arange(-180.0, 181.0, 5.0))
    found = rock.wall_displacement(angle) * np.exp(-1j * angle)
    fine = np.radians(np.arange(-180.0, 181.0))
    exact = hole.plate.at(hole.radius * np.exp(1j * fine)).polar_displacement(fine)
    for component, (colour, name) in enumerate(((RADIAL, "radial, outward"), (HOOP, "hoop"))):
        values = (found.real, found.imag)[component]
        axes.plot(np.degrees(angle), 1e3 * values, "o", color=colour, markersize=3, label=name)
        axes.plot(np.degrees(fine), 1e3 * exact[component], color="black", linewidth=1.0)
    axes.set(title="Biaxial: displacement of the wall", xlabel="angle (degrees)", ylabel="displacement (mm)")
    axes.set_xticks(range(-180, 181, 90))
    axes.margins(y=0.15)
    axes.legend(ncols=2, loc="upper center")


def draw_order(axes, series: dict[str, list[Point]], name: str, what: str) -> None:
    """One error against cell size, log-log, with its order and a line of order one."""
    for method, points in series.items():
        cells = [point.cell for point in points]
        errors = [100 * getattr(point, name) for point in points]
        label = f"{method}: order {order(points, name):.2f}" if len(points) > 1 else method
        axes.plot(cells, errors, "o-", color=TREATMENT_COLOURS.get(method), label=label)
    guide(axes, series)
    axes.set(title=f"Error of the {what}", ylabel="r.m.s. share (%)")


def draw_wall_errors(axes, series: dict[str, list[Point]], treatment: str) -> None:
    """Error of the hoop stress at the wall by treatment of cut cells, and of its extrapolation."""
    for method, points in series.items():
        cells = [point.cell for point in points]
        axes.plot(cells, [100 * p.wall for p in points], "o-", color=TREATMENT_COLOURS.get(method), label=method)
    for method in series.keys() & {treatment}:
        points = series[method]
        cells = [point.cell for point in points]
        label = f"{method}, extrapolated"
        axes.plot(cells, [100 * p.extrapolated for p in points], "s--", color=style.RECORDED, label=label)
    guide(axes, series)
    axes.set(title="Error of the wall's hoop stress", ylabel="r.m.s. share (%)")


def guide(axes, series: dict[str, list[Point]]) -> None:
    """Set log-log axes, ticks at the cell sizes, a dotted line of order one, and room for the legend."""
    axes.set(xscale="log", yscale="log", xlabel="finest cell h (m)")
    cells = sorted({point.cell for points in series.values() for point in points})
    low = min((value for line in axes.lines for value in line.get_ydata()), default=1.0)
    axes.plot(cells, 0.6 * low * np.array(cells) / min(cells, default=1.0), ":", color="black", label="order 1")
    axes.set_ylim(bottom=low / 20)
    axes.set_xticks(cells, [f"{cell:g}" for cell in cells])
    axes.minorticks_off()
    axes.grid(True, which="major", color="0.9")
    axes.legend(loc="lower right")
