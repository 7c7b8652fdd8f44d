"""The grid of a scene from its solids: the refined cells, and the part of each cell inside each excavation.

The walls of an opening that is narrow for its cells close too little (an under-resolved opening). Walls in different
cells have nodes of their own (model/phantom_nodes.py). But rock on both sides of an opening within one cell is tied
together, and an edge without a node of its own (grid/edge_nodes.py) ties two walls. The cells across an opening tell
which are narrow, wherever they lie on the grid (geometry/thickness.py). A scene is refused by the share of the openings
in cells that are mined wholly (`whole_shares`); study openings shows the effect of that share.
"""

import json
import logging

import numpy as np
import xarray as xr

from common.errors import InputError
from mpm_core.files.state_datasets import grid_dataset
from mpm_core.geometry.crossing import in_box
from mpm_core.geometry.inside import CROSSED, INSIDE, OUTSIDE, SAMPLES_PER_CELL, classify_cells, contains, sample_mask
from mpm_core.geometry.solids import Outside, Solid
from mpm_core.geometry.thickness import Across, cells_across
from mpm_core.grid.building import GridCount, build_grid, count_cells
from mpm_core.grid.distorted_cells import distorted_shapes, fullest_samples, part_integrals, points_with_volume
from mpm_core.grid.domain import Domain, base_cells
from mpm_core.grid.edge_nodes import EdgeNodes, choose_edge_nodes
from mpm_core.grid.edge_points import EdgePoints, edge_points
from mpm_core.grid.octree import Classify, all_cells, children, morton_codes
from mpm_core.grid.splitting import code_of
from mpm_core.model.occupancy import ALL_SAMPLES, MIN_SAMPLES_KEPT, FinestPieces
from mpm_core.scene.rock_blocks import block_attributes, check_blocks, read_blocks
from mpm_core.scene.scene_solids import bodies_at, read_solids
from mpm_core.settings import GridCells, GridSlice
from mpm_core.stages.stage_memory import require, stage_bytes

# A scene is refused if a smaller share of the volume of all openings, or of one, is in whole cells. Rock in partly
# mined cells then decides where the other rock breaks.
MIN_WHOLE_CELL_SHARE_ACCEPTED = 0.05
BOX_ROUND_OFF = 1e-9  # Round-off of a solid's bounding box, as a share of its size.
MAX_EXCAVATIONS_LISTED = 5  # Excavations that one message lists.
CELLS_PER_CHUNK = 2048  # Distorted cells whose points are held at once.


def whole_shares(parts: FinestPieces, shape: np.ndarray, later: np.ndarray) -> np.ndarray:
    """Share of each excavation's volume (k,) in finest cells that are mined wholly, by it and others; 0 without parts.

    shape (d,): finest cells along each axis; later (k,) bool: those mined after the first step, which make no cell
    whole for one of the first.
    """
    code = code_of(parts.place, shape)
    mined = np.bitwise_count(parts.samples).astype(float)
    share = np.zeros(len(later))
    for ours, others in ((~later, ~later), (later, np.ones_like(later))):
        there, own = np.flatnonzero(others[parts.excavation]), np.flatnonzero(ours[parts.excavation])
        order = there[np.argsort(code[there], kind="stable")]
        first = np.flatnonzero(np.diff(code[order], prepend=-1))
        if not len(own):
            continue
        whole = code[order][first[np.bitwise_or.reduceat(parts.samples[order], first) == ALL_SAMPLES]]
        size, in_whole = (
            np.bincount(parts.excavation[own], value, minlength=len(later))
            for value in (mined[own], mined[own] * np.isin(code[own], whole))
        )
        share += np.divide(in_whole, size, out=np.zeros(len(later)), where=size > 0.0)
    return share


def domain_of(values: GridSlice) -> Domain:
    """The domain of the grid's configuration slice."""
    lower, upper = (np.array(corner) for corner in (values.domain.lower, values.domain.upper))
    coarse = values.grid.coarse_cell
    return Domain(lower, base_cells(lower, upper, coarse), coarse, values.grid.levels)


def cut_pieces(
    index: np.ndarray,
    domain: Domain,
    solids: list[Solid | Outside],
    chosen: np.ndarray,
    cells: GridCells,
    edge_nodes: EdgeNodes,
) -> FinestPieces:
    """Parts of finest cells inside chosen excavations (k,), numbers of solids, by excavation and cell.

    edge_nodes: which move corners of the cells.

    index (n, d): lower corners of the finest cells that may be, fine units, in Morton order. With `cut_cells: whole`
    cells are in or out by the half.
    """
    fine = domain.cell(domain.levels - 1)
    # Cells of one base cell stand together (Morton order): a solid is compared with few base cells, not with all finest
    # cells.
    halvings = domain.levels - 1
    base = index >> halvings
    start = np.flatnonzero(np.append(True, (base[1:] != base[:-1]).any(axis=1))) if len(base) else np.empty(0, int)
    end, base = np.append(start[1:], len(index)), base[start]
    bent_place, corners = distorted_shapes(edge_nodes.place, edge_nodes.shift)
    bent_code = code_of(bent_place, domain.base_shape << halvings)
    parts = []
    for number in chosen:
        solid = solids[number]
        lower = (solid.bounds[0] - domain.lower) / fine - 2  # a distorted cell may reach a cell beyond its place
        upper = (solid.bounds[1] - domain.lower) / fine + 1
        first, last = np.floor(lower / 2**halvings), np.floor(upper / 2**halvings)
        blocks = np.flatnonzero(((base >= first) & (base <= last)).all(axis=1))
        near = np.concatenate([np.arange(start[block], end[block]) for block in blocks] or [np.empty(0, int)])
        near = near[in_box(index[near], lower, upper)]
        kind = classify_cells(solid, domain.lower, fine, index[near])
        samples = np.where(kind == INSIDE, ALL_SAMPLES, np.uint64(0))
        crossed = (kind != INSIDE) & (kind != OUTSIDE)
        samples[crossed] = sample_mask(solid, domain.lower, fine, index[near][crossed])
        if len(bent_code):
            place = np.searchsorted(bent_code, code_of(index[near], domain.base_shape << halvings))
            place = np.minimum(place, len(bent_code) - 1)
            bent = np.flatnonzero((bent_place[place] == index[near]).all(axis=1))
            bent = bent[~_are_amid_alike(index[near], kind, bent, (lower, upper))]
            samples[bent] = _samples_inside(solid, domain, index[near][bent], corners[place[bent]])
        if cells.cut_cells == "whole":
            samples = np.where(np.bitwise_count(samples) >= SAMPLES_PER_CELL // 2, ALL_SAMPLES, np.uint64(0))
        keep = np.bitwise_count(samples) >= MIN_SAMPLES_KEPT
        parts.append(FinestPieces(index[near][keep], np.full(keep.sum(), number, np.int16), samples[keep]))
    return FinestPieces.all_of(parts, len(domain.lower))


def _are_amid_alike(
    index: np.ndarray, kind: np.ndarray, chosen: np.ndarray, box: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """(k,) bool: True where all around a chosen cell (k,) is inside a solid, or all outside. What a distorted
    cell reaches is then as the cell itself.

    index (n, d), kind (n,): the finest cells in a box of cells, beyond which all is outside. A cell in it that is not
    among these is coarser, or beyond the domain: then nothing is said.
    """
    if not len(chosen):
        return np.zeros(0, bool)
    shape = np.floor(box[1]).astype(np.int64) + 3  # room for all around: no two cells have one code
    codes = code_of(index + 1, shape)
    order = np.argsort(codes)
    codes, kind = codes[order], kind[order]
    lowest, highest = np.full(len(chosen), INSIDE), np.full(len(chosen), OUTSIDE)
    for step in all_cells((3,) * index.shape[1]) - 1:
        cell = index[chosen] + step
        code = code_of(cell + 1, shape)
        place = np.minimum(np.searchsorted(codes, code), len(codes) - 1)
        of_cell = np.where(codes[place] == code, kind[place], np.where(in_box(cell, *box), CROSSED, OUTSIDE))
        lowest, highest = np.minimum(lowest, of_cell), np.maximum(highest, of_cell)
    return (lowest == highest) & (lowest != CROSSED)


def _samples_inside(solid: Solid | Outside, domain: Domain, index: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Samples (k,) uint64 inside a solid of distorted finest cells at places (k, d), with corners (k, 2^d, d).

    One point a sample would meet walls along the sides of distorted cells all at once, or not at all.
    """
    samples = np.empty(len(index), np.uint64)
    for first in range(0, len(index), CELLS_PER_CHUNK):
        chunk = slice(first, first + CELLS_PER_CHUNK)
        places, volume = points_with_volume(corners[chunk])
        points = index[chunk, None, None, :] + places
        points = domain.lower + points.reshape(-1, index.shape[1]) * domain.cell(domain.levels - 1)
        filled = np.where(contains(solid, points).reshape(volume.shape), volume, 0.0)
        samples[chunk] = fullest_samples(filled.sum(axis=2), volume.sum(axis=2), index.shape[1])
    return samples


def refuse_missed(solid: Solid | Outside, cells: GridCells) -> None:
    """Raise InputError for an excavation that no cell has a part of; where all of it may be missed (volume_error) only
    warn. A surface that stands twice, once turned inward, encloses nothing."""
    where = f"excavations.{solid.name}: adds no volume"
    _refuse_empty(solid, where)
    thin = f"{where}: it is thinner than a fraction of the finest cell, {cells.size_text()}"
    if cells.volume_error < 1.0:
        raise InputError(f"{thin}; use smaller cells (grid.finest_cell, or more grid.levels), or leave it out")
    logging.warning("%s, and left out", thin)


def _refuse_empty(solid: Solid | Outside, where: str) -> None:
    if solid.volume <= BOX_ROUND_OFF * np.prod(np.ptp(solid.bounds, axis=0)):
        raise InputError(
            f"{where}: its surface encloses nothing; where it stands twice, once turned inward, the two cancel: delete "
            "one of them, or leave it out"
        )


def warn_of_missed(bodies: list[Solid | Outside], body: np.ndarray, domain: Domain, values: GridSlice) -> None:
    """Warn of rock bodies in the domain that no cell is of; body (cell,): as `bodies_at` says. Raise InputError for one
    that encloses nothing."""
    for number in np.setdiff1d(np.arange(len(bodies)), body):
        where, (lower, upper) = f"rock_bodies.{bodies[number].name}", bodies[number].bounds
        if (upper <= domain.lower).any() or (lower >= domain.upper).any():
            continue  # read_solids has said so
        _refuse_empty(bodies[number], where)
        remedy = (
            "" if values.rock_bodies[number].refine else f"; refine: true gives it those of {values.grid.size_text()}"
        )
        logging.warning(
            "%s: no cell has its centre in this rock, which counts only where a step splits cells: they are too large, "
            "or bodies after it in the mine file cover it%s", where, remedy,
        )  # fmt: skip


def touches(solids: list[Solid | Outside], domain: Domain, level: int, index: np.ndarray) -> np.ndarray:
    """(n,) bool: True where a cell (n, d) of a level, each once, is not wholly outside these solids."""
    if not len(index):
        return np.zeros(0, bool)
    touched, size, shape = np.zeros(len(index), bool), domain.cell(level), domain.base_shape << level
    code = code_of(index, shape)
    order = np.argsort(code)
    code = code[order]
    for solid in solids:
        lower, upper = np.floor((solid.bounds - domain.lower) / size).astype(np.int64)
        lower, upper = np.clip(lower - 1, 0, shape), np.clip(upper + 2, 0, shape)
        sides = np.maximum(upper - lower, 0)
        if np.prod(sides.astype(float)) < len(index):  # most solids are small, and there may be thousands
            wanted = code_of(lower + all_cells(sides), shape)
            place = np.minimum(np.searchsorted(code, wanted), len(code) - 1)
            near = order[place[code[place] == wanted]]
        else:
            near = np.flatnonzero(in_box(index, lower, upper - 1))
        near = near[~touched[near]]
        touched[near] = classify_cells(solid, domain.lower, size, index[near]) != OUTSIDE
    return touched


def touched_cells(solids: list[Solid | Outside], domain: Domain) -> np.ndarray:
    """Lower corners (n, d) int32, fine units, of the finest cells whose parents these solids touch, in Morton order."""
    index = all_cells(domain.base_shape)
    for level in range(domain.levels - 1):
        index = children(index[touches(solids, domain, level, index)])
    code = np.empty(len(index), np.int64)
    morton_codes(index, code)
    return index[np.argsort(code, kind="stable")]


def compare_volumes(name: str, solid: float, gridded: float, cells: GridCells) -> None:
    """Log an excavation's volumes, m3; raise InputError if they differ by more than volume_error of the solid's."""
    error = gridded / solid - 1.0 if solid > 0 else np.inf
    logging.info("%s: %.1f m3, on the grid %.1f m3 (%+.2f %%)", name, solid, gridded, 100 * error)
    if abs(error) > cells.volume_error:
        raise InputError(
            f"excavations.{name}: {solid:.4g} m3 in the domain as a solid but {gridded:.4g} m3 on the grid "
            f"({100 * error:+.0f} %): too thin for cells of {cells.size_text()}; use smaller ones "
            "(grid.finest_cell, or more grid.levels), mend the solid, or allow "
            f"more by grid.volume_error (now {cells.volume_error:g})"
        )


def warn_of_narrow(names: list[str], across: list[Across], size: np.ndarray, cells: GridCells) -> list[str]:
    """Names of excavations with fewer cells across than they need, each with a warning; size (k,) m3: those that no
    cell has a part of are left out."""
    narrow = [number for number, one in enumerate(across) if one.is_narrow() and size[number] > 0.0]
    for number in narrow:
        if not across[number].cells > 0.0:
            logging.warning(
                "%s: a quarter of its surface or more encloses nothing, as a repeated sheet does; its cells across are "
                "not known; export it again as one closed surface", names[number],
            )  # fmt: skip
            continue
        logging.warning(
            "%s: narrow for cells of %s: %.1f across it, of %d that it needs; use cells of %g m or less",
            names[number], cells.size_text(), across[number].cells, across[number].needed,
            across[number].largest_cell(cells.finest),
        )  # fmt: skip
    return [names[number] for number in narrow]


def refuse_under_resolved(share: np.ndarray, size: np.ndarray, cells: GridCells) -> None:
    """Raise InputError if hardly any cell is mined wholly.

    share (k,): of each excavation's volume in wholly mined cells, size (k,) m3. From a volume_error of 1 on anything
    goes.
    """
    if size.sum() > 0.0 and share @ size < MIN_WHOLE_CELL_SHARE_ACCEPTED * size.sum() and cells.volume_error < 1.0:
        raise InputError(
            f"excavations: too narrow for cells of {cells.size_text()}: {100 * (share @ size) / size.sum():.0f} % of "
            "their volume fills whole ones, and the rock in the others would prop them; use cells of half their width "
            "or less, or grid.cut_cells: whole"
        )


def cells_of_draft(values: GridSlice, solids: list[Solid | Outside], later: np.ndarray) -> tuple[GridSlice, np.ndarray]:
    """The cells of a draft, and the numbers of the excavations for which it keeps those of the mine's file.

    later (k,) bool: mined after the first step. A draft doubles the cells of the file. No rock fails around an opening
    of which hardly any fills whole cells (study openings), so a draft keeps the cells of the file where doubled ones
    would make an opening such.
    """
    if values.grid.resized_by != "draft" or values.grid.volume_error >= 1.0:
        return values, np.empty(0, int)
    finer = values.grid.model_copy(update={"levels": values.grid.levels + 1, "resized_by": None})
    kept = values.model_copy(update={"grid": finer})

    def shares(choice: GridSlice) -> np.ndarray:
        domain = domain_of(choice)
        pieces = cut_pieces(
            touched_cells(solids, domain), domain, solids, np.arange(len(solids)), choice.grid,
            edge_nodes_of(choice, solids, domain),
        )  # fmt: skip
        return whole_shares(pieces, domain.base_shape << domain.levels - 1, later)

    lost = np.flatnonzero(shares(values) < MIN_WHOLE_CELL_SHARE_ACCEPTED)
    lost = lost[shares(kept)[lost] >= MIN_WHOLE_CELL_SHARE_ACCEPTED] if len(lost) else lost
    if not len(lost):
        return values, lost
    names, more = (
        ", ".join(solids[number].name for number in lost[:MAX_EXCAVATIONS_LISTED]),
        len(lost) - MAX_EXCAVATIONS_LISTED,
    )
    logging.warning(
        "accuracy: draft keeps cells of %s: hardly any cell of twice that size would lie wholly in %s%s",
        kept.grid.size_text(), names, f" and {more} more" if more > 0 else "",
    )  # fmt: skip
    return kept, lost


def draft_keeps_cells(values: GridSlice | dict) -> bool:
    """True if a draft with the doubled cells of this slice keeps those of the mine's file."""
    values = GridSlice.of(values)
    values = values.model_copy(update={"grid": values.grid.model_copy(update={"resized_by": "draft"})})
    solids = read_solids(values.excavations, "excavations", domain_of(values))
    _, lost = cells_of_draft(values, solids, np.isin(np.arange(len(solids)), values.later))
    return len(lost) > 0


def volumes_of(pieces: FinestPieces, edge_nodes: EdgeNodes, domain: Domain) -> np.ndarray:
    """Volume of each part, in finest cells, (piece,)."""
    place, corners = distorted_shapes(edge_nodes.place, edge_nodes.shift)
    volume, shape = np.bitwise_count(pieces.samples) / SAMPLES_PER_CELL, domain.base_shape << domain.levels - 1
    if not len(place):
        return volume
    code, own = code_of(place, shape), code_of(pieces.place, shape)
    row = np.minimum(np.searchsorted(code, own), len(code) - 1)
    bent = np.flatnonzero(code[row] == own)
    volume[bent] = part_integrals(corners[row[bent]], pieces.samples[bent]).volume
    return volume


def edge_nodes_of(values: GridSlice, solids: list[Solid | Outside], domain: Domain) -> EdgeNodes:
    """Nodes that are moved onto edges of excavations: with `cut_cells: mean`."""
    if values.grid.cut_cells != "mean":
        return EdgeNodes.none(len(domain.lower))
    fine = domain.cell(domain.levels - 1)
    return choose_edge_nodes(solids, domain.lower, fine, domain.base_shape << domain.levels - 1)


def edge_points_of(values: GridSlice, solids: list[Solid | Outside], nodes: EdgeNodes, domain: Domain) -> EdgePoints:
    """Points along edges of excavations: with `cut_cells: mean`; nodes: those that are moved onto edges."""
    if values.grid.cut_cells != "mean":
        return EdgePoints.none(len(domain.lower))
    fine = domain.cell(domain.levels - 1)
    return edge_points(solids, nodes, domain.lower, fine, domain.base_shape << domain.levels - 1)


def require_memory(count: GridCount, dimension: int, cells: GridCells) -> None:
    """Raise InputError if the stages that follow, one particle to a cell, would not fit into the free memory."""
    require(
        stage_bytes("multigrid", dimension, count.cells, count.cells),
        f"grid: {count.cells:,} cells, the finest of {cells.size_text()}, {count.nodes:,} nodes, "
        "in the stages that follow",
        "use larger cells (grid.finest_cell, or grid.coarse_cell), fewer grid.buffer_cells or a smaller domain",
    )


def features_of(values: GridSlice, bodies: list[Solid | Outside]) -> list[Solid | Outside]:
    """The rock bodies whose surfaces have fine cells."""
    return [solid for solid, entry in zip(bodies, values.rock_bodies, strict=True) if entry.refine]


def fine_around(mined: list[Solid | Outside], features: list[Solid | Outside], domain: Domain) -> Classify:
    """The cells that are split: those that solids touch, and those that surfaces of features cross."""

    def classify(level: int, index: np.ndarray) -> np.ndarray:
        marked = touches(mined, domain, level, index)
        for solid in features:
            rest = np.flatnonzero(~marked)
            kind = classify_cells(solid, domain.lower, domain.cell(level), index[rest])
            marked[rest] = (kind != OUTSIDE) & (kind != INSIDE)
        return marked

    return classify


def cells_at_start(values: GridSlice | dict) -> int:
    """Number of cells of the grid that `make_grid` would make, which is not made. A draft's own cells are those of
    twice the size, even where it would keep those of the file."""
    values = GridSlice.of(values)
    domain = domain_of(values)
    solids = read_solids(values.excavations, "excavations", domain)
    bodies = read_solids(values.rock_bodies, "rock_bodies", domain, values.far_field is not None)
    first = [solid for number, solid in enumerate(solids) if number not in values.later]
    classify = fine_around(first, features_of(values, bodies), domain)
    return count_cells(domain.base_shape, domain.levels, classify, values.grid.buffer_cells).cells


def make_grid(values: GridSlice | dict, attributes: dict) -> xr.Dataset:
    """The dataset of grid.nc from the grid's configuration slice, or its values; attributes: provenance.

    Cells are fine around what the first step mines; of what is mined later it has the parts of finest cells alone.
    """
    values = GridSlice.of(values)
    dimension, domain = values.dimension, domain_of(values)
    solids = read_solids(values.excavations, "excavations", domain)
    later = np.isin(np.arange(len(solids)), values.later)
    values, lost = cells_of_draft(values, solids, later)
    domain = domain_of(values)
    bodies = read_solids(values.rock_bodies, "rock_bodies", domain, values.far_field is not None)
    blocks = read_blocks(values.blocks) if values.blocks else None
    if blocks is not None:
        check_blocks(blocks.blocks)
    first, after = ([solids[number] for number in np.flatnonzero(chosen)] for chosen in (~later, later))
    grid = build_grid(
        domain.lower,
        domain.coarse_cell,
        domain.base_shape,
        domain.levels,
        fine_around(first, features_of(values, bodies), domain),
        values.grid.buffer_cells,
        before_allocation=lambda count: require_memory(count, dimension, values.grid),
    )
    finest = grid.cell_index[grid.cell_level == grid.levels - 1]
    edge_nodes = edge_nodes_of(values, solids, domain)
    pieces = cut_pieces(finest, domain, solids, np.flatnonzero(~later), values.grid, edge_nodes)
    if later.any():
        touched = touched_cells(after, domain)
        of_later = cut_pieces(touched, domain, solids, np.flatnonzero(later), values.grid, edge_nodes)
        pieces = pieces.and_then(of_later)
    for number in np.setdiff1d(np.arange(len(solids)), pieces.excavation):
        refuse_missed(solids[number], values.grid)
    thickness = values.thickness if dimension == 2 else 1.0
    share, names = whole_shares(pieces, grid.shape, later), [solid.name for solid in solids]
    pieces = pieces.apart()
    of_pieces = volumes_of(pieces, edge_nodes, domain) * (grid.fine_cell**dimension * thickness)
    on_grid = np.bincount(pieces.excavation, of_pieces, minlength=len(solids)).astype(float)  # integers without pieces
    volume = [solid.volume_within(domain.lower, domain.upper) * thickness for solid in solids]
    for solid, true, gridded in zip(solids, volume, on_grid, strict=True):
        compare_volumes(solid.name, true, float(gridded), values.grid)
    refuse_under_resolved(share, on_grid, values.grid)
    top = np.inf if values.plane == "xy" else domain.lower[-1] + grid.shape[-1] * grid.fine_cell
    across = [cells_across(solid, grid.fine_cell, top) for solid in solids]
    narrow = warn_of_narrow(names, across, on_grid, values.grid)
    body = bodies_at(bodies, grid.cell_center, blocks)
    warn_of_missed(bodies, body, domain, values)
    return grid_dataset(
        grid,
        body,
        pieces,
        of_pieces,
        edge_nodes,
        edge_points_of(values, solids, edge_nodes, domain),
        values.plane,
        attributes
        | {
            "mine": values.name,
            "thickness": thickness,
            "excavation_names": json.dumps(names),
            "excavation_volume": json.dumps(volume),
            "excavation_volume_grid": json.dumps([float(value) for value in on_grid]),
            "excavation_open_share": json.dumps([solid.open_share for solid in solids]),
            "excavation_whole_share": json.dumps([float(value) for value in share]),
            "excavation_cells_across": json.dumps([one.cells for one in across]),
            "excavation_cells_needed": json.dumps([one.needed for one in across]),
            "excavation_narrow": json.dumps(narrow),
            "draft_would_lose": json.dumps([names[number] for number in lost]),
            "rock_body_names": json.dumps([solid.name for solid in bodies]),
        }
        | block_attributes(values.blocks, blocks, body - len(bodies), grid.cell_size**dimension)
        | far_field_attributes(values),
        solids,
    )


def far_field_attributes(values: GridSlice) -> dict:
    """Attributes of a derived domain: distance and radius in m, the expected error of wall stress in percent; else
    nothing."""
    far = values.far_field
    if far is None:
        return {}
    message = f"domain: {far.distance:.4g} m from the openings; moves wall stress by {100 * far.error:.2g} % at most"
    reason = {
        "memory": "; a larger one takes too much memory on these cells: use a larger grid.finest_cell",
        "strength": "; beyond it virgin rock stands above its strength (insitu_stress, materials.host)",
        "": "",
    }[far.limited]
    logging.log(logging.WARNING if reason else logging.INFO, "%s%s", message, reason)
    return {
        "far_field_distance": far.distance,
        "far_field_radius": far.radius,
        "far_field_error": 100 * far.error,
        "far_field_limited": far.limited,
    }
