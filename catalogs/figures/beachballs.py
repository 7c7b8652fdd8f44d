"""Beach balls of full moment tensors: the sign of first motion over the lower focal hemisphere, equal-area projection.

ObsPy's `beach` draws the two nodal planes of a double couple and goes wrong where a source also opens or closes; here
the sign of r.M.r is drawn itself, so an explosion is a full disc and an implosion an empty one.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from catalogs.figures import style

BALLS_PER_ROW = 5
PIXELS_ACROSS = 201  # Pixels across the square around the projection.


def lower_hemisphere(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Unit vectors (..., xyz: east, north, up) at points of the equal-area projection with unit radius.

    Points between radius 1 and sqrt(2) lie on the upper hemisphere, so that a drawing may run past the rim.
    """
    square = np.minimum(x**2 + y**2, 2.0)
    along = np.sqrt(2.0 - square)
    return np.stack([x * along, y * along, square - 1.0], axis=-1)


def first_motion(tensor: np.ndarray, samples: int = PIXELS_ACROSS) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Outward first motion r.M.r on a square around the projection: x (samples,), y (samples,), motion (y, x).

    tensor: (3, 3) moment tensor, any unit, axes east, north, up, outward motion positive; scaled to unit norm.
    """
    line = np.linspace(-1.0, 1.0, samples)
    ray = lower_hemisphere(*np.meshgrid(line, line))
    scale = np.linalg.norm(tensor)
    return line, line, np.einsum("...i,ij,...j->...", ray, tensor / scale if scale > 0 else tensor, ray)


def draw_ball(
    axes: Axes,
    tensor: np.ndarray,
    colour: str = style.MODELLED,
    *,
    centre: tuple[float, float] = (0.0, 0.0),
    radius: float = 1.0,
    samples: int = PIXELS_ACROSS,
    linewidth: float = 0.9,
) -> None:
    """Draw one ball: coloured where first motion is outward (dilated, as the paper's Fig. 16), white where inward.

    centre, radius: in the units of the axes; samples: pixels across; linewidth: of the rim, points.
    """
    x, y, motion = first_motion(tensor, samples)
    disc = Circle(centre, radius, facecolor="white", edgecolor="none", zorder=4)
    axes.add_patch(disc)
    if motion.max() > 0:
        place = centre[0] + radius * x, centre[1] + radius * y
        drawn = axes.contourf(*place, motion, levels=[0.0, 2.0], colors=[colour], zorder=5)
        drawn.set_clip_path(disc)
    axes.add_patch(Circle(centre, radius, facecolor="none", edgecolor="k", linewidth=linewidth, zorder=6))


def beach_balls(moment_tensors: np.ndarray, titles: list[str], axes_of: np.ndarray, colour: str) -> Figure:
    """A sheet of beach balls, north up, with P and T axes marked.

    moment_tensors: (event, 3, 3); titles: one per event; axes_of: (event, 2, xyz) unit vectors of P and T.
    """
    rows = -(-len(titles) // BALLS_PER_ROW)
    figure = style.new_figure(height=2.45 * rows)
    array = figure.subplots(rows, BALLS_PER_ROW, squeeze=False).ravel()
    for axes in array:
        axes.set_axis_off()
    for axes, tensor, title, pair in zip(array, moment_tensors, titles, axes_of, strict=False):
        draw_ball(axes, tensor, colour=colour)
        for vector, name in zip(pair, "PT", strict=True):
            if np.isnan(vector).any():  # an axis that is not clear
                continue
            axes.text(
                *project(vector), name, fontsize=8.5, ha="center", va="center", zorder=7,
                bbox={"boxstyle": "circle,pad=0.12", "facecolor": "white", "edgecolor": "k", "linewidth": 0.5},
            )  # fmt: skip
        axes.plot([0, 0], [1.0, 1.1], color="k", linewidth=0.9)
        axes.text(0, 1.14, "N", fontsize=7.5, ha="center", va="bottom")
        axes.set_title(title, fontsize=8.5, fontweight="normal", loc="center", pad=8, y=style.TITLE_PLACE)
        axes.set_xlim(-1.1, 1.1)
        axes.set_ylim(-1.1, 1.3)
        axes.set_aspect("equal")
    return figure


def project(vector: np.ndarray) -> np.ndarray:
    """Point (x, y) of an axis on the equal-area lower-hemisphere projection of unit radius."""
    vector = np.asarray(vector, dtype=float)
    if vector[2] > 0:
        vector = -vector
    return vector[:2] / np.sqrt(1.0 - vector[2])
