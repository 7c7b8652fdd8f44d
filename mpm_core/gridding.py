"""From solids to the grid of a scene: which cells are refined, which part of each cell is inside which excavation."""

import json
import logging
from collections.abc import Sequence

import numpy as np
import xarray as xr

from mpm_core.datasets import grid_dataset
from mpm_core.domain import Domain, base_cells
from mpm_core.geometry.files import Picked, read_outline, read_solid
from mpm_core.geometry.inside import INSIDE, OUTSIDE, classify_cells, contains, sample_mask
from mpm_core.geometry.shapes import build_shape
from mpm_core.geometry.solids import Outside, Solid
from mpm_core.grid.building import GridCount, build_grid
from mpm_core.grid.mesh import MultiLevelGrid
from mpm_core.grid.octree import RefinedVolume
from mpm_core.memory import require, stage_bytes
from mpm_core.occupancy import FULL, SAMPLES, SLIVER, Pieces
from mpm_core.scene import DRAFT_LEVELS, PLANES
from mpm_core.settings import GridSlice, SolidSettings
from pipeline.errors import InputError

ZONE_RINGS = 2  # of the draft's finest cells around those that failed
ROUND_OFF = 1e-6  # of a cell: positions are those of particles


def read_solids(entries: Sequence[SolidSettings], section: str, domain: Domain) -> list[Solid | Outside]:
    """Solids of a section of the configuration ("excavations"), in order; `outside`: what they leave of the domain.

    entries: or their values.

    Raises InputError naming the entry, also for one that lies outside the domain.
    """
    dimension = len(domain.lower)
    solids = []
    for entry in (SolidSettings.of(one, section) for one in entries):
        try:
            if entry.file and dimension == 2:
                raise InputError(f"{entry.name}: file: a plane strain scene needs a shape in its plane, not a solid")
            if entry.file and entry.shape:
                solids.append(build_shape(with_outline(entry), dimension))
            elif entry.file:
                solids.append(read_solid(entry.file, entry.name, Picked.of(entry.given())))
            else:
                solids.append(build_shape(entry.given(), dimension))
        except InputError as error:
            raise InputError(f"{section}.{entry.name}: {str(error).removeprefix(entry.name + ': ')}") from error
        check_inside(solids[-1], domain, section, bool(entry.file))
        if entry.outside:
            solids[-1] = Outside(solids[-1], domain.lower, domain.upper)
    return solids


def with_outline(entry: SolidSettings) -> dict:
    """A prism's keys with the polygon of its drawing; `height` stands on the polyline's own elevations."""
    given = entry.given()
    outline = read_outline(entry.file, entry.name, Picked.of(given))
    made = given | {"polygon": outline[:, :2].tolist()}
    if entry.height:
        made |= {"base": outline[:, 2].tolist(), "top": (outline[:, 2] + entry.height).tolist()}
    return made


def domain_of(values: GridSlice) -> Domain:
    """The domain of the grid's configuration slice."""
    lower, upper = (np.array(corner) for corner in (values.domain.lower, values.domain.upper))
    coarse = values.grid.coarse_cell
    return Domain(lower, base_cells(lower, upper, coarse), coarse, values.grid.levels)


def check_inside(solid: Solid, domain: Domain, section: str, from_file: bool = False) -> None:
    """Raise InputError for a solid outside the domain; one that is partly outside is cut off at the boundary."""
    lower, upper = solid.bounds
    if (upper <= domain.lower).any() or (lower >= domain.upper).any():
        raise InputError(
            f"{section}.{solid.name}: lies outside the domain ({_span(lower, upper)}; "
            f"domain {_span(domain.lower, domain.upper)}): check its coordinates"
            f"{', its units, scale and offset' if from_file else ''} and domain.lower, domain.upper"
        )
    if (lower < domain.lower).any() or (upper > domain.upper).any():
        logging.warning("%s.%s reaches beyond the domain; the part inside is used", section, solid.name)


def _span(lower, upper) -> str:
    return ", ".join(f"{a:.10g} to {b:.10g} m" for a, b in zip(lower, upper, strict=True))


def cut_pieces(grid: MultiLevelGrid, domain: Domain, solids: list[Solid | Outside], whole: bool, draft: bool) -> Pieces:
    """Parts of the finest cells inside each excavation, by excavation and cell. `whole`: in or out by the half.

    Raises InputError for an excavation that is too thin for these cells; a draft does without it.
    """
    finest = np.flatnonzero(grid.cell_level == grid.levels - 1).astype(np.int32)
    index = grid.cell_index[finest]
    # Cells of one base cell stand together (Morton order): a solid looks at few base cells, not at all finest cells.
    halvings = grid.levels - 1
    base = index >> halvings
    start = np.flatnonzero(np.append(True, (base[1:] != base[:-1]).any(axis=1))) if len(base) else np.empty(0, int)
    end, base = np.append(start[1:], len(index)), base[start]
    parts = []
    for number, solid in enumerate(solids):
        lower = (solid.bounds[0] - domain.lower) / grid.fine_cell - 1
        upper = (solid.bounds[1] - domain.lower) / grid.fine_cell
        first, last = np.floor(lower / 2**halvings), np.floor(upper / 2**halvings)
        blocks = np.flatnonzero(((base >= first) & (base <= last)).all(axis=1))
        near = np.concatenate([np.arange(start[block], end[block]) for block in blocks] or [np.empty(0, int)])
        near = near[((index[near] >= lower) & (index[near] <= upper)).all(axis=1)]
        kind = classify_cells(solid, domain.lower, grid.fine_cell, index[near])
        samples = np.where(kind == INSIDE, FULL, np.uint64(0))
        crossed = (kind != INSIDE) & (kind != OUTSIDE)
        samples[crossed] = sample_mask(solid, domain.lower, grid.fine_cell, index[near][crossed])
        if whole:
            samples = np.where(np.bitwise_count(samples) >= SAMPLES // 2, FULL, np.uint64(0))
        keep = np.bitwise_count(samples) >= SLIVER
        if not keep.any() and not draft:
            raise InputError(
                f"excavations.{solid.name}: adds no volume: it is thinner than a fraction of the finest cell, "
                f"{grid.fine_cell:g} m; refine grid.levels or leave it out"
            )
        parts.append((finest[near][keep], np.full(keep.sum(), number), samples[keep]))
    if not parts:
        return Pieces(np.empty(0, np.int32), np.empty(0, np.int16), np.empty(0, np.uint64))
    cell, excavation, samples = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Pieces(cell.astype(np.int32), excavation.astype(np.int16), samples)


def compare_volumes(name: str, solid: float, gridded: float, allowed: float, cell: float) -> None:
    """Log an excavation's volumes, m3; raise InputError if they differ by more than a share `allowed` of the solid's.

    cell: edge of the finest cells, m.
    """
    error = gridded / solid - 1.0 if solid > 0 else np.inf
    logging.info("%s: %.1f m3, on the grid %.1f m3 (%+.2f %%)", name, solid, gridded, 100 * error)
    if abs(error) > allowed:
        raise InputError(
            f"excavations.{name}: {solid:.4g} m3 in the domain as a solid but {gridded:.4g} m3 on the grid "
            f"({100 * error:+.0f} %): too thin for cells of {cell:g} m; refine grid.levels, mend the solid, or allow "
            f"more by grid.volume_error (now {allowed:g})"
        )


def assign_bodies(grid: MultiLevelGrid, bodies: list[Solid | Outside]) -> np.ndarray:
    """Rock body of each cell by its centre, later ones winning: (cell,) int16, -1 host."""
    body = np.full(len(grid.cell_level), -1, np.int16)
    for number, solid in enumerate(bodies):
        body[contains(solid, grid.cell_center)] = number
    return body


def require_memory(count: GridCount, dimension: int) -> None:
    """Raise InputError if the stages that follow, one particle to a cell, would not fit into the free memory."""
    require(
        stage_bytes("multigrid", dimension, count.cells, count.cells),
        f"grid: {count.cells:,} cells, {count.nodes:,} nodes, in the stages that follow",
        "use fewer grid.levels, a larger grid.coarse_cell, fewer grid.buffer_cells or a smaller domain",
    )


def failure_zone(draft: xr.Dataset, domain: Domain, axes: tuple[int, ...]) -> RefinedVolume:
    """Where rock failed in a draft's last step (see workflow/draft.py), with rings of the draft's finest cells.

    A failed cell of any size counts with all of its volume.
    """
    level = max(domain.levels - DRAFT_LEVELS - 1, 0)
    failed = draft.failed.values >= 0
    position, spacing = draft.position.values[failed][:, axes], draft.spacing.values[failed]
    lowest = np.floor((position - 0.5 * spacing[:, None] - domain.lower) / domain.cell(level) + ROUND_OFF).astype(int)
    width = np.maximum(np.rint(spacing / domain.cell(level)).astype(int), 1)
    index = [np.empty((0, len(axes)), int)]
    for size in np.unique(width):
        offsets = np.stack(np.meshgrid(*[np.arange(size)] * len(axes), indexing="ij"), axis=-1).reshape(-1, len(axes))
        index.append((lowest[width == size][:, None] + offsets).reshape(-1, len(axes)))
    index = np.unique(np.concatenate(index), axis=0)
    logging.info("failure zone: %d draft cells of %g m", len(index), domain.cell(level))
    return RefinedVolume(level, index.astype(np.int32), ZONE_RINGS)


def make_grid(values: GridSlice, attributes: dict, draft: xr.Dataset | None = None) -> xr.Dataset:
    """The dataset of grid.nc from the grid's configuration slice, or its values; attributes: provenance.

    draft: state of the last step of the draft run, if there is one: fine cells where rock failed in it.
    """
    values = GridSlice.of(values)
    dimension, domain = values.dimension, domain_of(values)
    solids = read_solids(values.excavations, "excavations", domain)
    bodies = read_solids(values.rock_bodies, "rock_bodies", domain)
    features = [solid for solid, entry in zip(bodies, values.rock_bodies, strict=True) if entry.refine]

    def classify(level: int, index: np.ndarray) -> np.ndarray:
        marked = np.zeros(len(index), bool)
        for solid in solids:
            rest = np.flatnonzero(~marked)
            marked[rest] = classify_cells(solid, domain.lower, domain.cell(level), index[rest]) != OUTSIDE
        for solid in features:
            rest = np.flatnonzero(~marked)
            kind = classify_cells(solid, domain.lower, domain.cell(level), index[rest])
            marked[rest] = (kind != OUTSIDE) & (kind != INSIDE)
        return marked

    grid = build_grid(
        domain.lower,
        domain.coarse_cell,
        domain.base_shape,
        domain.levels,
        classify,
        values.grid.buffer_cells,
        extra_marks=[] if draft is None else [failure_zone(draft, domain, PLANES[values.plane])],
        before_allocation=lambda count: require_memory(count, dimension),
    )
    pieces = cut_pieces(grid, domain, solids, values.grid.cut_cells == "whole", values.grid.draft)
    thickness = values.thickness if dimension == 2 else 1.0
    on_grid = np.bincount(pieces.excavation, np.bitwise_count(pieces.samples) / 64, minlength=len(solids))
    on_grid = on_grid * grid.fine_cell**dimension * thickness  # not in place: integers where nothing is mined
    volume = [solid.volume_within(domain.lower, domain.upper) * thickness for solid in solids]
    allowed = np.inf if values.grid.draft else values.grid.volume_error
    for solid, true, gridded in zip(solids, volume, on_grid, strict=True):
        compare_volumes(solid.name, true, float(gridded), allowed, grid.fine_cell)
    return grid_dataset(
        grid,
        assign_bodies(grid, bodies),
        pieces,
        values.plane,
        attributes
        | {
            "mine": values.name,
            "thickness": thickness,
            "excavation_names": json.dumps([solid.name for solid in solids]),
            "excavation_volume": json.dumps(volume),
            "excavation_volume_grid": json.dumps([float(value) for value in on_grid]),
            "rock_body_names": json.dumps([solid.name for solid in bodies]),
        }
        | far_field_attributes(values),
    )


def far_field_attributes(values: GridSlice) -> dict:
    """Of a derived domain: distance and radius in m, the expected error of wall stress in percent; else nothing."""
    far = values.far_field
    if far is None:
        return {}
    said = f"domain: {far.distance:.4g} m from the openings; moves wall stress by {100 * far.error:.2g} % at most"
    if far.limited:
        logging.warning("%s; a larger one takes too much memory on these cells: use a larger grid.finest_cell", said)
    else:
        logging.info("%s", said)
    return {
        "far_field_distance": far.distance,
        "far_field_radius": far.radius,
        "far_field_error": 100 * far.error,
        "far_field_limited": int(far.limited),
    }
