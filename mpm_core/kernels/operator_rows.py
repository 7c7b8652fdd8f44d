"""Operations of the elastic operator and its solver by row: copies of nodes, transfer between levels, vector sums.

Nodal arrays are flat: row r holds elements r width to r width + width - 1, width 4 in 3-D and 2 in 2-D. Every element
is written by one thread, sums are made in one fixed order: the result does not depend on the number of threads.
"""

import numpy as np
from numba import njit, prange

from mpm_core.simd.lanes import POINT_WIDTH, prefetch

PREFETCH_LINKS = 128  # Rows are fetched into the cache this many links before their use, since they may be anywhere.
ELEMENTS_PER_CHUNK = 8192  # Elements are summed one after the other within chunks, whose sums are then added in order.


def make_spread(width: int):
    """The kernel for rows of this width."""

    @njit(parallel=True, error_model="numpy", cache=True)
    def spread_to_copies(copies, copy_start, parents, values):
        """Copies take the mean of their parents: values (row * width,), in place; see multigrid.siblings."""
        for copy in prange(len(copies)):
            first, last = copy_start[copy], copy_start[copy + 1]
            weight = values.dtype.type(1.0 / (last - first))
            here = copies[copy] * width
            for k in range(width):
                values[here + k] = values[parents[first] * width + k]
            for link in range(first + 1, last):
                for k in range(width):
                    values[here + k] += values[parents[link] * width + k]
            for k in range(width):
                values[here + k] *= weight

    return spread_to_copies


def make_collect(width: int):
    """The kernel for rows of this width."""

    @njit(parallel=True, error_model="numpy", cache=True)
    def collect_from_copies(targets, target_start, sources, source_weights, values):
        """Rows take what their copies hold, by weight: values (row * width,), in place. Copies keep theirs, stale."""
        last = len(sources) - 1
        for target in prange(len(targets)):
            here = targets[target] * width
            for link in range(target_start[target], target_start[target + 1]):
                prefetch(values, sources[min(link + PREFETCH_LINKS, last)] * width)
                weight = values.dtype.type(source_weights[link])
                there = sources[link] * width
                for k in range(width):
                    values[here + k] += weight * values[there + k]

    return collect_from_copies


def make_restrict(width: int):
    """The kernel for rows of this width."""

    @njit(parallel=True, error_model="numpy", cache=True)
    def restrict(row_node, link_start, links, fine_weights, fine, coarse):
        """Coarse rows take what the finer level holds, by the transpose of `prolong`: coarse (row * width,), written.

        row_node (coarse row,): see multigrid.siblings; links: rows of the finer level; fine_weights (fine row,).
        """
        last = len(links) - 1
        for row in prange(len(row_node)):
            here = row * width
            for k in range(width):
                coarse[here + k] = 0.0
            node = row_node[row]
            if node >= 0:
                for link in range(link_start[node], link_start[node + 1]):
                    prefetch(fine, links[min(link + PREFETCH_LINKS, last)] * width)
                    weight = fine_weights[links[link]]
                    there = links[link] * width
                    for k in range(width):
                        coarse[here + k] += weight * fine[there + k]

    return restrict


def make_prolong(width: int):
    """The kernel for rows of this width."""

    @njit(parallel=True, error_model="numpy", cache=True)
    def prolong(row_node, parent_start, parents, inverse_diagonal, coarse, step, solution):
        """Step of the finer level = mean of each row's coarse parents, 0 where D^-1 is 0; added to the solution.

        row_node (fine row,): see multigrid.siblings; parents: coarse rows. Hanging nodes have none; D^-1 is 0 there.
        """
        for row in prange(len(row_node)):
            here = row * width
            for k in range(width):
                step[here + k] = 0.0
            node = row_node[row]
            if node >= 0:
                first, last = parent_start[node], parent_start[node + 1]
                for link in range(first, last):
                    there = parents[link] * width
                    for k in range(width):
                        step[here + k] += coarse[there + k]
                weight = step.dtype.type(1.0 / (last - first))
                for k in range(width):
                    step[here + k] = weight * step[here + k] if inverse_diagonal[here + k] != 0.0 else 0.0
                    solution[here + k] += step[here + k]

    return prolong


SPREAD = {dimension: make_spread(width) for dimension, width in POINT_WIDTH.items()}
COLLECT = {dimension: make_collect(width) for dimension, width in POINT_WIDTH.items()}
RESTRICT = {dimension: make_restrict(width) for dimension, width in POINT_WIDTH.items()}
PROLONG = {dimension: make_prolong(width) for dimension, width in POINT_WIDTH.items()}
"""by dimension"""


@njit(parallel=True, error_model="numpy", cache=True)
def gather_rows(row_node, inverse_diagonal, width, values, rows):
    """Values at nodes (node, d) to rows (row * width,), written; 0 on copies and where D^-1 is 0."""
    for row in prange(len(row_node)):
        for k in range(width):
            element = row * width + k
            if k < values.shape[1] and inverse_diagonal[element] != 0.0:
                rows[element] = values[row_node[row], k]
            else:
                rows[element] = 0.0


@njit(parallel=True, error_model="numpy", cache=True)
def scatter_rows(node_row, width, rows, values):
    """Own rows to values at nodes (node, d), written; hanging nodes get what stands in their copy."""
    for node in prange(len(node_row)):
        for k in range(values.shape[1]):
            values[node, k] = rows[node_row[node] * width + k]


@njit(parallel=True, error_model="numpy", cache=True)
def smooth_first(inverse_diagonal, factor, residual, step, solution):
    """First step of a smoother: step = solution = factor D^-1 residual. All (element,)."""
    for i in prange(len(step)):
        step[i] = factor * inverse_diagonal[i] * residual[i]
        solution[i] = step[i]


@njit(parallel=True, error_model="numpy", cache=True)
def smooth_next(inverse_diagonal, keep, factor, change, residual, step, solution):
    """Next step: residual -= change (0 where D^-1 is 0), step = keep step + factor D^-1 residual, solution += step."""
    for i in prange(len(step)):
        rest = residual[i] - change[i] if inverse_diagonal[i] != 0.0 else residual.dtype.type(0.0)
        residual[i] = rest
        step[i] = keep * step[i] + factor * inverse_diagonal[i] * rest
        solution[i] += step[i]


@njit(parallel=True, error_model="numpy", cache=True)
def subtract(inverse_diagonal, change, residual):
    """residual -= change; 0 where D^-1 is 0 (held, copy, nothing attached). All (element,)."""
    for i in prange(len(residual)):
        residual[i] = residual[i] - change[i] if inverse_diagonal[i] != 0.0 else residual.dtype.type(0.0)


@njit(parallel=True, error_model="numpy", cache=True)
def mask(inverse_diagonal, values):
    """values (element,) = 0 where D^-1 is 0, in place."""
    for i in prange(len(values)):
        if inverse_diagonal[i] == 0.0:
            values[i] = 0.0


@njit(parallel=True, error_model="numpy", cache=True)
def scale_residual(inverse_diagonal, factor, residual, scaled):
    """scaled = factor residual in the type of `scaled`, 0 where D^-1 is 0. All (element,)."""
    for i in prange(len(scaled)):
        scaled[i] = factor * residual[i] if inverse_diagonal[i] != 0.0 else 0.0


@njit(parallel=True, error_model="numpy", cache=True)
def turn_direction(inverse_diagonal, factor, solution, keep, direction):
    """direction = factor solution + keep direction, 0 where D^-1 is 0. All (element,)."""
    for i in prange(len(direction)):
        if inverse_diagonal[i] != 0.0:
            direction[i] = factor * solution[i] + keep * direction[i]
        else:
            direction[i] = 0.0


@njit(parallel=True, error_model="numpy", cache=True)
def add_scaled(factor, change, values):
    """values += factor change. Both (element,)."""
    for i in prange(len(values)):
        values[i] += factor * change[i]


@njit(parallel=True, error_model="numpy", cache=True)
def _chunk_products(first, second, sums):
    for chunk in prange(len(sums)):
        total = 0.0
        for i in range(chunk * ELEMENTS_PER_CHUNK, min((chunk + 1) * ELEMENTS_PER_CHUNK, len(first))):
            total += first[i] * second[i]
        sums[chunk] = total


@njit(parallel=True, error_model="numpy", cache=True)
def take_step(inverse_diagonal, step, displacement, force, elastic):
    """displacement += step, and elastic -= force where D^-1 is not 0; force becomes 0. All (element,)."""
    for i in prange(len(step)):
        displacement[i] += step[i]
        if inverse_diagonal[i] != 0.0:
            elastic[i] -= force[i]
        force[i] = 0.0


@njit(parallel=True, error_model="numpy", cache=True)
def _balance(inverse_diagonal, elastic, flow, residual, sums, largest):
    """residual = elastic + flow, 0 where D^-1 is 0; by chunk: its square, summed, and its largest size."""
    for chunk in prange(len(sums)):
        total, size = 0.0, 0.0
        for i in range(chunk * ELEMENTS_PER_CHUNK, min((chunk + 1) * ELEMENTS_PER_CHUNK, len(residual))):
            force = elastic[i] + flow[i] if inverse_diagonal[i] != 0.0 else 0.0
            residual[i] = force
            total += force * force
            size = max(size, abs(force))
        sums[chunk], largest[chunk] = total, size


def balance(inverse_diagonal, elastic: np.ndarray, flow: np.ndarray, residual: np.ndarray) -> tuple[float, float]:
    """residual (element,) = elastic + flow, 0 where D^-1 is 0, written; its 2-norm and its largest size."""
    sums = np.empty(-(-len(residual) // ELEMENTS_PER_CHUNK))
    largest = np.empty_like(sums)
    _balance(inverse_diagonal, elastic, flow, residual, sums, largest)
    return float(np.sqrt(sums.sum())), float(largest.max())


def product(first: np.ndarray, second: np.ndarray) -> float:
    """Scalar product of two flat arrays, the same bits with any number of threads."""
    sums = np.empty(-(-len(first) // ELEMENTS_PER_CHUNK))
    _chunk_products(first, second, sums)
    return float(sums.sum())
