"""One table of every field that a dataset of this package holds: it names, measures and documents them."""

import numpy as np
import xarray as xr

from common.errors import InputError
from common.fields import Field
from mpm_core.model.state import ARRAYS, PARTICLES, TENSORS

CELLS = ("cell",)
STORED = {array.field.name: array.field for array in ARRAYS.values() if array.stored}
"""what the files have of a state, as declared there"""


def _table(*entries: Field | str) -> dict[str, Field]:
    """Fields by name, in the order of the files; a name: of a state's, of which those that are not named come last."""
    table: dict[str, Field] = {}
    for entry in entries:
        table |= {entry: STORED[entry]} if isinstance(entry, str) else {entry.name: entry}
    return table | {name: entry for name, entry in STORED.items() if name not in table}


FIELDS = _table(
    # cells: of grid.nc, of which the first step starts, and of each state
    Field("cell_origin", ("cell", "xyz"), np.float64, "m", "lower corner of each cell"),
    Field("cell_size", CELLS, np.float64, "m", "edge of each cell"),
    Field("cell_level", CELLS, np.int8, "1", "level, 0 coarsest"),
    Field("cell_nodes", ("cell", "corner"), np.int32, "1", "nodes at the corners, VTK hexahedron or quad order"),
    Field("cell_body", CELLS, np.int16, "1", "index of the rock body, -1 host"),
    Field(
        "node_position",
        ("node", "xyz"),
        np.float64,
        "m",
        "place of each node",
    ),
    Field("node_parents", ("node", "parent"), np.int32, "1", "a hanging node moves with the mean of these, -1 none"),
    Field("piece_origin", ("piece", "xyz"), np.float64, "m", "lower corner of each finest cell inside an excavation"),
    Field("piece_excavation", ("piece",), np.int16, "1", "index of that excavation"),
    Field("piece_samples", ("piece",), np.uint64, "1", "64 points of the cell, one bit each: inside or not"),
    Field("piece_fraction", ("piece",), np.float64, "1", "share of these points that are inside"),
    Field("edge_node_place", ("edge_node", "xyz"), np.float64, "m", "place of each node that is moved onto an edge"),
    Field("edge_node_shift", ("edge_node", "xyz"), np.float64, "m", "how far it is moved"),
    # elastic.nc and steps/<step>.nc
    "position",
    "cell",
    Field("spacing", PARTICLES, np.float64, "m", "distance to its neighbours in the same cell, or the cell's edge"),
    Field("volume", PARTICLES, np.float64, "m3", "volume of the particle's own material; 0 once mined"),
    Field("material", PARTICLES, np.int16, "1", "index into the attribute material_names"),
    Field("excavation", PARTICLES, np.int16, "1", "excavation whose fill this is, -1 rock"),
    Field("displacement", ("particle", "xyz"), np.float64, "m", "displacement since virgin"),
    "stress",
    "failed",
    "failure_order",
    "seismic_strain",
    "overshoot_strain",
    "later_strain",
    Field("plastic_strain_step", TENSORS, np.float64, "1", "plastic strain of this step: the three above together"),
    "plastic_strain",
    Field("strength_factor", PARTICLES, np.float64, "1", "strength over stress, at most 10; 10 where nothing can fail"),
    Field("excess_shear_stress", PARTICLES, np.float64, "Pa", "largest shear stress above strength over all planes"),
    "node_displacement",
    "node_velocity",
    "hourglass_force",
    Field("loose_cell", ("loose",), np.int32, "1", "cell of each part that has come loose so far, and fallen"),
    Field("loose_samples", ("loose",), np.uint64, "1", "64 points of the cell, one bit each: loose or not"),
    Field("loose_step", ("loose",), np.int32, "1", "index of the step in which it came loose"),
    Field("loose_piece", ("loose",), np.int32, "1", "piece among those of that step, 0 the largest"),
    Field("convergence_increment", ("iteration",), np.int32, "1", "increment of the ramp, 1 first"),
    Field("convergence_generation", ("iteration",), np.int32, "1", "generation of failure within the increment"),
    Field("convergence_iteration", ("iteration",), np.int32, "1", "iteration of the stage at this check"),
    Field("convergence_unbalanced_ratio", ("iteration",), np.float64, "1", "unbalanced force over load, 2-norms"),
    Field("convergence_max_ratio", ("iteration",), np.float64, "1", "largest unbalanced force over the same"),
    Field("convergence_cells", ("iteration",), np.int32, "1", "cells relaxed: all, or a part of the mine alone"),
    Field("convergence_new_failures", ("iteration",), np.int32, "1", "particles that failed after this check"),
)


def variable(name: str, values: np.ndarray) -> xr.Variable:
    """A variable of the table with its attributes. Raises InputError if a number in it is not finite."""
    field = FIELDS[name]
    values = np.ascontiguousarray(values, dtype=field.dtype)
    if field.dtype == np.float64 and not np.isfinite(values).all():
        raise InputError(
            f"{name}: not a number at {int((~np.isfinite(values)).sum())} places; the state is not written"
        )
    return xr.Variable(field.dims, values, {"units": field.unit, "long_name": field.meaning})
