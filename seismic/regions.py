"""Events as regions of rock that failed together, touch, and have like mechanisms.

Two failed particles are linked where their cells touch, over a face, an edge or a corner, they failed in the same
increment at most one generation apart, and the cosine of their potency tensors is above the threshold. Links through
faces alone would cut a crack one cell thick into its level stretches: the cells along a plane are connected over faces
and edges (Andres et al. 1997), those along a line over corners, too. In return two cracks are separate only where the
intact cells between them are connected through faces (Kong and Rosenfeld 1989).

Regions grow from single particles along these links: in each round every region chooses one that it is linked to, and
two that choose each other join. It chooses the one with the largest

    cosine of both tensors * links between both / sqrt(particles of the smaller)

among those with which it may join. (The surface of a region grows roughly with this root, and the number of links
measures the area of a surface with little influence of its orientation; study clustering.) Two regions may join if

    |sum P| >= threshold * sum |P|    over the particles of both,

where the left side over the right one is the mean cosine between a particle and its event's tensor, weighted by
potency; and if no particle is opposed to that tensor, so a chain of links cannot join opposite mechanisms. Much smaller
regions (MAX_JOINING_SHARE) that choose a region which has just grown join it in the same round, the best first, if they
still may: otherwise a large region would absorb one neighbour a round. The process ends when no two regions may join.
Which regions join depends on their surroundings, not on the rest of the mine, and not on the order of the particles:
sums are added in the order of the particles' positions, and ties are broken by a number derived from these.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seismic.clusters import neighbour_pairs, number_by_first
from seismic.families import NINE_COMPONENT_WEIGHTS

# Cells touch if their centres are apart, along each axis, by at most this factor times half the sum of their sizes.
TOUCHING_TOLERANCE = 1.05
FACES, EDGES, CORNERS = 1, 2, 3  # reach of links: axes along which cells that touch lie side by side, at most
MAX_GENERATIONS_APART = 1  # Generations of failure by which linked particles may differ.
# A region with at most this share of another's particles need not wait until that one chooses it.
MAX_JOINING_SHARE = 0.003


def find_regions(
    position: NDArray,
    spacing: NDArray,
    potency: NDArray,
    failure_order: NDArray,
    threshold: float,
    reach: int = CORNERS,
) -> NDArray:
    """Event of every particle, (particle,) int64 from 0, numbered by each one's first particle.

    position (particle, 3) m; spacing (particle,) m; potency (particle, 6) m3, tensor shear, none of them zero;
    failure_order (particle, 2): increment and generation; threshold: cosine above 0 and below 1; reach: FACES, EDGES or
    CORNERS, over which cells are linked.
    """
    position = np.asarray(position, np.float64)
    if len(position) == 0:
        return np.empty(0, np.int64)
    potency, failure_order = np.asarray(potency, np.float64), np.asarray(failure_order)
    order = np.lexsort(position.T)
    if not np.diff(position[order], axis=0).any(axis=1).all():  # particles may lie at one place
        order = np.lexsort((*failure_order.T[::-1], *potency.T, *position.T))
    tensor = potency[order] * NINE_COMPONENT_WEIGHTS
    tensor /= np.abs(tensor).max()  # no underflow when squared
    spacing = np.asarray(spacing, np.float64)[order]
    first, second = links(position[order], spacing, tensor, failure_order[order], threshold, reach)
    region = grow(tensor, lots(position[order]), first, second, threshold)
    label = np.empty(len(order), np.int64)
    label[order] = region
    return number_by_first(label)


def links(
    position: NDArray,
    spacing: NDArray,
    tensor: NDArray,
    failure_order: NDArray,
    threshold: float,
    reach: int = CORNERS,
) -> tuple[NDArray, NDArray]:
    """Linked particles, first < second, (link,) int64 each.

    Arguments are those of find_regions; tensor components are multiplied by NINE_COMPONENT_WEIGHTS.
    """
    first, second, _ = neighbour_pairs(position, spacing, failure_order[:, 0], np.sqrt(3.0) * TOUCHING_TOLERANCE)
    first, second = np.minimum(first, second), np.maximum(first, second)
    unit = tensor / np.linalg.norm(tensor, axis=1)[:, None]
    generation = failure_order[:, 1].astype(np.int64)
    linked = _are_linked(first, second, position, spacing, unit, generation, threshold, reach)
    return first[linked], second[linked]


@njit(cache=True)
def _are_linked(first, second, position, spacing, unit, generation, threshold, reach):
    """(pair,) bool: True where a pair of particles touches, failed at most one generation apart, and is alike."""
    linked = np.zeros(len(first), np.bool_)
    for pair in range(len(first)):
        a, b = first[pair], second[pair]
        half = 0.5 * (spacing[a] + spacing[b])
        farthest, beside, cosine = 0.0, 0, 0.0
        for axis in range(3):
            apart = abs(position[a, axis] - position[b, axis])
            farthest = max(farthest, apart)
            beside += apart * TOUCHING_TOLERANCE > half
        for k in range(6):
            cosine += unit[a, k] * unit[b, k]
        touch = farthest <= TOUCHING_TOLERANCE * half and beside <= reach
        linked[pair] = touch and abs(generation[a] - generation[b]) <= MAX_GENERATIONS_APART and cosine > threshold
    return linked


def lots(position: NDArray) -> NDArray:
    """A random-looking number of each place, (particle,) uint64: splitmix64 of the bits of its coordinates."""
    bits = np.ascontiguousarray(position + 0.0).view(np.uint64)  # + 0.0: no negative zero
    lot = np.zeros(len(position), np.uint64)
    for column in bits.T:
        lot = _mix(lot + column)
    return lot


def _mix(value: NDArray) -> NDArray:
    value = value + np.uint64(0x9E3779B97F4A7C15)
    value = (value ^ (value >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    value = (value ^ (value >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return value ^ (value >> np.uint64(31))


def grow(
    tensor: NDArray, lot: NDArray, first: NDArray, second: NDArray, threshold: float, small: float = MAX_JOINING_SHARE
) -> NDArray:
    """Region of every particle, (particle,) int64: the number of one of its particles. Mutual best joining, see above.

    tensor (particle, 6) times NINE_COMPONENT_WEIGHTS; lot (particle,); first, second (link,): pairs of particles.
    """
    count = len(tensor)
    total, scalar, size = tensor.copy(), np.linalg.norm(tensor, axis=1), np.ones(count)
    region, following, last = np.arange(count), np.full(count, -1), np.arange(count)
    least = np.ones(count)  # (region,) the smallest cosine of a particle with the region's tensor
    best, score = np.empty(count, np.int64), np.empty(count)
    hub, place = np.empty(count, np.int64), np.full(count, -1)
    shared = np.ones(len(first))
    linked = np.arange(count)
    first, second, shared = _gather(linked, region, first, second, shared, hub, place)
    while len(first):
        linked = _with_links(linked, first, second, hub)
        _choose(tensor, total, scalar, size, least, following, lot, first, second, shared, threshold, best, score)
        choice = best[linked]
        alone = linked[(choice != linked) & (best[choice] != linked)]
        alone = alone[np.argsort(-score[alone], kind="stable")]  # not in the kernel: a sort takes long to compile
        if not _join(
            linked, alone, best, threshold, small, tensor, total, scalar, size, least, region, following, last, hub
        ):
            break
        first, second, shared = _gather(linked, region, first, second, shared, hub, place)
    return region


@njit(cache=True)
def _gather(linked, region, first, second, shared, start, place):
    """The links between regions, after their particles' regions have changed: first, second, shared (link,).

    Links between the same pair of regions are merged into one, and their counts `shared` are added; first < second, in
    the order of first. linked (k,): the regions that had links, ascending; start, place (region,): work arrays; place
    is -1 before the first call, and later calls get it as the one before left it.
    """
    for a in linked:
        start[a] = 0
    for link in range(len(first)):
        a, b = region[first[link]], region[second[link]]
        if a != b:
            start[min(a, b)] += 1
    count = 0
    for a in linked:
        start[a], count = count, count + start[a]
    other, many = np.empty(count, np.int64), np.empty(count)
    for link in range(len(first)):
        a, b = region[first[link]], region[second[link]]
        if a != b:
            a, b = min(a, b), max(a, b)
            other[start[a]], many[start[a]] = b, shared[link]
            start[a] += 1
    own = np.empty(count, np.int64)
    kept = begin = 0  # what is kept overwrites what has been read
    for a in linked:
        row = kept
        for link in range(begin, start[a]):
            b = other[link]
            if row <= place[b] < kept and other[place[b]] == b:
                many[place[b]] += many[link]
            else:
                place[b] = kept
                own[kept], other[kept], many[kept] = a, b, many[link]
                kept += 1
        begin = start[a]
    return own[:kept].copy(), other[:kept].copy(), many[:kept].copy()


@njit(cache=True)
def _with_links(linked, first, second, mark):
    """The regions among `linked` that still have links, (k,) ascending; mark (region,): work array."""
    for a in linked:
        mark[a] = 0
    for link in range(len(first)):
        mark[first[link]] = mark[second[link]] = 1
    return linked[mark[linked] == 1]


@njit(inline="always")
def _products(total, a, b):
    """Products of two regions' tensors: of the first with itself, of both, of the second with itself."""
    aa = ab = bb = 0.0
    for k in range(6):
        aa += total[a, k] * total[a, k]
        ab += total[a, k] * total[b, k]
        bb += total[b, k] * total[b, k]
    return aa, ab, bb


@njit(cache=True)
def _choose(tensor, total, scalar, size, least, following, lot, first, second, shared, threshold, best, score):
    """The region that each linked region would best join, itself where there is none; best, score (region,) in place.

    shared (link,): how many links of particles each pair of regions has.
    """
    for link in range(len(first)):
        for region in (first[link], second[link]):
            best[region], score[region] = region, -1.0
    for link in range(len(first)):
        a, b = first[link], second[link]
        aa, ab, bb = _products(total, a, b)
        value = ab / np.sqrt(aa * bb) * shared[link] / np.sqrt(min(size[a], size[b]))
        if value < score[a] and value < score[b]:
            continue
        if not _may_join(a, b, threshold, tensor, total, scalar, least, following):
            continue
        for own, other in ((a, b), (b, a)):
            if value < score[own]:
                continue
            lots, chosen = lot[own] ^ lot[other], lot[own] ^ lot[best[own]]
            if value > score[own] or lots > chosen or (lots == chosen and other < best[own]):
                score[own], best[own] = value, other


@njit(cache=True)
def _may_join(a, b, threshold, tensor, total, scalar, least, following):
    """True if two regions may join: their mechanisms are similar, and no particle is opposed to their tensor."""
    aa, ab, bb = _products(total, a, b)
    joined = np.sqrt(aa + 2.0 * ab + bb)
    if joined < threshold * (scalar[a] + scalar[b]):
        return False
    # Surely none is opposed where its angle to the old tensor and that of old and new one are below 90 degrees.
    turn_a, turn_b = (aa + ab) / (np.sqrt(aa) * joined), (ab + bb) / (np.sqrt(bb) * joined)
    sure_a = turn_a > 0.0 and least[a] ** 2 > 1.0 - turn_a**2
    sure_b = turn_b > 0.0 and least[b] ** 2 > 1.0 - turn_b**2
    if not sure_a and _opposed(a, a, b, tensor, total, following):
        return False
    return sure_b or not _opposed(b, a, b, tensor, total, following)


@njit(cache=True)
def _opposed(particle, a, b, tensor, total, following):
    """True if one of a chain of particles is opposed to the tensors of two regions together."""
    while particle >= 0:
        product = 0.0
        for k in range(6):
            product += tensor[particle, k] * (total[a, k] + total[b, k])
        if product <= 0.0:
            return True
        particle = following[particle]
    return False


@njit(cache=True)
def _join(linked, alone, best, threshold, small, tensor, total, scalar, size, least, region, following, last, hub):
    """Join regions that chose each other, and small ones to their choice, in place. Returns how many vanish.

    linked (k,): the regions that have links, ascending; alone: those of them whose choice chose another, best score
    first; best: as _choose left it.
    The particles of a region are a chain: it begins at the region's number, `following` (particle,) leads on, -1 at its
    end, and last (region,) is that end. hub (region,), work array: the region that a grown region, or a part of one,
    now belongs to.
    """
    for a in linked:
        hub[a] = -1
    gone = 0
    for a in linked:
        b = best[a]
        if a < b and best[b] == a:
            _add(a, b, tensor, total, scalar, size, least, following, last)
            hub[a] = hub[b] = a
            gone += 1
    for other in alone:
        own = hub[best[other]]
        if own < 0 or size[other] > small * size[own]:
            continue
        if _may_join(own, other, threshold, tensor, total, scalar, least, following):
            _add(own, other, tensor, total, scalar, size, least, following, last)
            gone += 1
    for a in linked:
        if hub[a] == a:
            whole = 0.0
            for k in range(6):
                whole += total[a, k] * total[a, k]
            least[a], particle = 1.0, a
            while particle >= 0:
                region[particle] = a
                square = product = 0.0
                for k in range(6):
                    square += tensor[particle, k] * tensor[particle, k]
                    product += tensor[particle, k] * total[a, k]
                least[a] = min(least[a], product / np.sqrt(square * whole))
                particle = following[particle]
    return gone


@njit(cache=True)
def _add(a, b, tensor, total, scalar, size, least, following, last):
    """Add region b to region a, in place; least becomes a bound: no particle's cosine with the tensor is below it."""
    aa, ab, bb = _products(total, a, b)
    for k in range(6):
        total[a, k] += total[b, k]
    joined = np.sqrt(aa + 2.0 * ab + bb)
    turned_a = np.arccos(least[a]) + np.arccos(min((aa + ab) / (np.sqrt(aa) * joined), 1.0))
    turned_b = np.arccos(least[b]) + np.arccos(min((ab + bb) / (np.sqrt(bb) * joined), 1.0))
    least[a] = np.cos(min(max(turned_a, turned_b), 0.5 * np.pi))
    scalar[a] += scalar[b]
    size[a] += size[b]
    following[last[a]], last[a] = b, last[b]
