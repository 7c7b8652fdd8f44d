"""Surfaces of stepped pits, open at the ground, whose volumes are known."""

import numpy as np

GROUND = 500.0  # m


def stepped_pit(
    radii=(100.0, 92.0, 84.0, 70.0), bench=15.0, sides=24, center=(0.0, 0.0), rim=GROUND
) -> tuple[np.ndarray, np.ndarray, float]:
    """Vertices, triangles that look into the pit, and volume m3 of a pit of upright walls and flat berms.

    Its outline is a polygon of so many sides; its benches are as high as `bench` m, the top one up to `rim`, elevation
    m. The volume is that below GROUND: a sum of prisms.
    """
    angle = 2.0 * np.pi * np.arange(sides) / sides
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    levels = GROUND - bench * np.arange(len(radii) + 1)
    rings = []
    for number, radius in enumerate(radii):
        for level in (rim if number == 0 else levels[number], levels[number + 1]):
            rings.append(np.column_stack([center + radius * circle, np.full(sides, level)]))
    vertices = np.concatenate([*rings, [[*center, levels[-1]]]])
    here, ahead, facets = np.arange(sides), np.roll(np.arange(sides), -1), []
    for ring in range(len(rings) - 1):
        upper, lower = ring * sides, (ring + 1) * sides
        facets.append(np.column_stack([upper + here, lower + ahead, lower + here]))
        facets.append(np.column_stack([upper + here, upper + ahead, lower + ahead]))
    floor = (len(rings) - 1) * sides
    facets.append(np.column_stack([floor + here, floor + ahead, np.full(sides, len(vertices) - 1)]))
    area = 0.5 * sides * np.sin(2.0 * np.pi / sides)
    return vertices, np.concatenate(facets), float(bench * area * np.sum(np.square(radii)))


def with_ground(vertices: np.ndarray, facets: np.ndarray, sides=24, width=60.0, rise=0.0):
    """A pit and a ring of ground around it, so wide m, whose outer edge lies `rise` m above GROUND."""
    rim = vertices[:sides]
    outer = rim + width * np.column_stack([rim[:, :2] / np.linalg.norm(rim[:, :2], axis=1)[:, None], np.zeros(sides)])
    outer[:, 2] = GROUND + rise
    here, ahead, first = np.arange(sides), np.roll(np.arange(sides), -1), len(vertices)
    ground = [np.column_stack([first + here, first + ahead, here]), np.column_stack([first + ahead, ahead, here])]
    return np.concatenate([vertices, outer]), np.concatenate([facets, *ground])


def write_obj(path, vertices: np.ndarray, facets: np.ndarray):
    """The surface as an OBJ file, whose path is returned."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    path.write_text("\n".join([*lines, *(f"f {a} {b} {c}" for a, b, c in (facets + 1).tolist())]) + "\n")
    return path
