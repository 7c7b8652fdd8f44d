"""Centre of the part of its cell that a particle represents."""

import numpy as np
import xarray as xr

# Variables of a state that part_centers needs.
PLACE_VARIABLES = ("position", "spacing", "cell", "cell_origin", "cell_size")


def part_centers(state: xr.Dataset) -> np.ndarray:
    """Centre of the part of its cell that each particle of a state stands for, (particle, 3) m.

    A particle that is alone in a cell that a wall cuts lies where its material is: its part is the cell. Any other lies
    at its part's centre. Parts of neighbours touch, positions need not.
    """
    center = state["position"].values.astype(np.float64)
    if "cell_size" not in state:
        return center
    cell = state["cell"].values
    size = state["cell_size"].values[cell]
    alone = np.flatnonzero(state["spacing"].values == size)
    plane = state.attrs.get("plane", "none")
    axes = [0, 1, 2] if plane == "none" else ["xyz".index(axis) for axis in plane]  # out of the plane cells have none
    origin = state["cell_origin"].values[cell[alone]]
    center[alone[:, None], axes] = (origin + 0.5 * size[alone, None])[:, axes]
    return center
