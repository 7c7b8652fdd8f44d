"""First failure: the particles above peak strength, and the brittle drop to residual strength.

Intact rock has `scale` times the strength of its material (model/variability.py): cohesion, tensile and uniaxial
strength, at the same friction. All laws have no other stress in them, so a stress is as far from a strength so scaled
as the stress divided by `scale` is from the material's own, times `scale`.
"""

import functools
import math

from numba import njit, prange

from mpm_core.constitutive.elastic import strain_from_stress
from mpm_core.constitutive.general import brittle_drop, strength_of
from mpm_core.constitutive.principal import principal_stresses
from mpm_core.kernels.energy_sums import total_stress

# Equilibrium is never exact, so rock may be above its strength by this share of strength and stress.
STRENGTH_MARGIN = 1e-5
# In place of the particle of a cell's sound rock: the cell has no such rock, or none that is compared with others.
NO_ROCK, NOT_FINEST = -1, -2
DROP_SHARE_HALVINGS = 20  # The share of the drop is found by as many halvings.


@njit(error_model="numpy", cache=True)
def judged_stress(stress, insitu, particle, to_front, i):
    """Six components, Pa, by which particle i of some is judged: its own, and the change to_front (k, 6) if given."""
    xx, yy, zz, yz, xz, xy = total_stress(stress, insitu, particle, particle)
    if not len(to_front):
        return xx, yy, zz, yz, xz, xy
    return (
        xx + to_front[i, 0],
        yy + to_front[i, 1],
        zz + to_front[i, 2],
        yz + to_front[i, 3],
        xz + to_front[i, 4],
        xy + to_front[i, 5],
    )


@njit(error_model="numpy", cache=True)
def scaled(stress, factor):
    """Six components of stress, times a factor."""
    return (
        stress[0] * factor,
        stress[1] * factor,
        stress[2] * factor,
        stress[3] * factor,
        stress[4] * factor,
        stress[5] * factor,
    )


@njit(error_model="numpy", cache=True)
def strength_at(strength_scale, particle):
    """Strength of intact rock at a particle over that of its material; strength_scale (particle,), or (0,) for 1."""
    return strength_scale[particle] if len(strength_scale) else 1.0


@functools.cache
def make_overstress_of(law):
    """The kernel for a law."""
    length = law.ROW_LENGTH

    @njit(parallel=True, error_model="numpy", cache=True)
    def overstress_of(candidates, stress, insitu, to_front, material, rows, strength_scale, excess):
        """Overstress of candidates, Pa: excess (candidate,), in place; 0 where bounds prove them below strength.

        candidates (candidate,) particle indices; stress, insitu (particle, 6) Pa; to_front (candidate, 6) Pa or (0, 6):
        see judged_stress; rows (material, column); strength_scale (particle,) or (0,): see strength_at.
        """
        for i in prange(len(candidates)):
            p = candidates[i]
            scale = strength_at(strength_scale, p)
            xx, yy, zz, yz, xz, xy = scaled(judged_stress(stress, insitu, p, to_front, i), 1.0 / scale)
            row = strength_of(rows, material[p], length)
            if law.surely_admissible(xx, yy, zz, yz, xz, xy, row):
                excess[i] = 0.0
            else:
                excess[i] = scale * law.overstress(xx, yy, zz, yz, xz, xy, row)

    return overstress_of


@njit(cache=True)
def size_of(xx, yy, zz, yz, xz, xy):
    """Norm of a stress, Pa: root of the sum of its squared components."""
    return math.sqrt(xx * xx + yy * yy + zz * zz + 2.0 * (yz * yz + xz * xz + xy * xy))


@njit(error_model="numpy", cache=True)
def strength_margin(stress, insitu, particle, strength):
    """Overstress that round-off may leave, Pa: in proportion to strength (Pa), virgin and present stress.

    So a scene of other strengths and stresses, all scaled alike, fails alike.
    """
    virgin = size_of(
        insitu[particle, 0], insitu[particle, 1], insitu[particle, 2],
        insitu[particle, 3], insitu[particle, 4], insitu[particle, 5],
    )  # fmt: skip
    present = size_of(*total_stress(stress, insitu, particle, particle))
    return STRENGTH_MARGIN * (strength + virgin + present)


@functools.cache
def make_is_above_strength(law):
    """The kernel for a law."""
    length = law.ROW_LENGTH

    @njit(parallel=True, error_model="numpy", cache=True)
    def is_above_strength(candidates, failed, stress, insitu, to_front, material, rows, strength_scale, above):
        """Find intact candidates above strength by more than a margin: above (candidate,) bool, written.

        failed (particle,) int32, -1 intact; other arguments as in overstress_of.
        """
        for i in prange(len(candidates)):
            p = candidates[i]
            above[i] = False
            if failed[p] >= 0:
                continue
            scale = strength_at(strength_scale, p)
            xx, yy, zz, yz, xz, xy = scaled(judged_stress(stress, insitu, p, to_front, i), 1.0 / scale)
            row = strength_of(rows, material[p], length)
            if not law.surely_admissible(xx, yy, zz, yz, xz, xy, row):
                margin = strength_margin(stress, insitu, p, scale * law.strength_size(row))
                above[i] = scale * law.overstress(xx, yy, zz, yz, xz, xy, row) > margin

    return is_above_strength


@njit(parallel=True, cache=True)
def any_neighbor(cells, neighbor_start, neighbors, chosen, found):
    """Find cells (k,) with a neighbour among the chosen (cell,) bool: found (k,) bool, written."""
    for i in prange(len(cells)):
        found[i] = False
        for link in range(neighbor_start[cells[i]], neighbor_start[cells[i] + 1]):
            found[i] |= chosen[neighbors[link]]


@njit(parallel=True, error_model="numpy", cache=True)
def stress_to_face(particles, cell, across, rock, part, position, fine_cell, failed, material, stress, insitu, change):
    """Change of stress from particles (k,) to the face of their cells at the front: change (k, 6) Pa, written.

    across (cell, 2 d): see grid.adjacency.cells_across; rock, part (cell,): see front.Front; position (particle, d) m;
    fine_cell m. Where rock has failed or is gone on one side of an axis alone, stress is linear along it, through the
    sound rock behind, to that side's face. The change is the mean over such axes, as the front stands across them all:
    at 1 / sqrt(2) of the distance to it where there are two. 0 away from the front.
    """
    for i in prange(len(particles)):
        p = particles[i]
        own = cell[p]
        for k in range(6):
            change[i, k] = 0.0
        if rock[own] != p:
            continue
        axes = 0
        for side in range(across.shape[1]):
            front, back = across[own, side], across[own, side ^ 1]
            if front < 0 or back < 0 or rock[front] == NOT_FINEST or rock[back] < 0:
                continue
            behind = rock[back]
            if (rock[front] >= 0 and failed[rock[front]] < 0) or failed[behind] >= 0 or material[behind] != material[p]:
                continue
            apart = abs(position[p, side // 2] - position[behind, side // 2])
            share = 0.5 * part[own] * fine_cell / max(apart, 0.5 * fine_cell)
            axes += 1
            for k in range(6):
                change[i, k] += share * (stress[p, k] + insitu[p, k] - stress[behind, k] - insitu[behind, k])
        if axes > 1:
            for k in range(6):
                change[i, k] /= axes


@functools.cache
def make_drop_share(law):
    """The kernel for a law."""
    length = law.ROW_LENGTH

    @njit(error_model="numpy")
    def supported(stress, tension, confinement, row):
        """Largest share, 0 to 1, of the stress without its largest component that is admissible at a confinement."""
        low, high = 0.0, 1.0
        margin = STRENGTH_MARGIN * law.strength_size(row)
        for _ in range(DROP_SHARE_HALVINGS):
            share = 0.5 * (low + high)
            xx, yy, zz = (
                share * (stress[0] - tension) + confinement,
                share * (stress[1] - tension) + confinement,
                share * (stress[2] - tension) + confinement,
            )
            if law.overstress(xx, yy, zz, share * stress[3], share * stress[4], share * stress[5], row) > margin:
                high = share
            else:
                low = share
        return low

    @njit(parallel=True, error_model="numpy", cache=True)
    def drop_share(particles, stress, insitu, to_face, material, intact_rows, residual_rows, strength_scale, share):
        """Share of differential stress that particles (k,) lose as they fail: share (k,), written.

        One less residual over intact strength, both at the confinement that acts at the face, whose stress is that of
        the particle and to_face (k, 6) Pa. Tension there counts as no confinement.
        """
        for i in prange(len(particles)):
            p = particles[i]
            at_face = judged_stress(stress, insitu, p, to_face, i)
            largest = principal_stresses(*at_face)[0]
            confinement = min(largest, 0.0)
            once = 1.0 / strength_at(strength_scale, p)
            intact_row = strength_of(intact_rows, material[p], length)
            intact = supported(scaled(at_face, once), once * largest, once * confinement, intact_row)
            residual = supported(at_face, largest, confinement, strength_of(residual_rows, material[p], length))
            share[i] = 1.0 - residual / intact if intact > 0.0 else 1.0

    return drop_share


@functools.cache
def make_drop(law):
    """The kernel for a law."""
    length = law.ROW_LENGTH

    @njit(error_model="numpy", cache=True)
    def drop(
        particles,
        stress,
        insitu,
        material,
        elastic_constants,
        intact_rows,
        residual_rows,
        strength_scale,
        overshoot_strain,
        seismic_strain,
        to_front,
        energy,
    ):
        """Brittle drop of the given particles (k,), in place: stress to residual; overshoot and seismic strain.

        The strains are those of the drop at the front, whose stress is that of the particle and to_front (k, 6) Pa; the
        particle's own stress falls by as much. What is then above residual strength is overshoot. energy (k, 2) J/m3,
        written: what overshoot and seismic strain dissipate at the particle, on two straight paths from trial stress to
        peak and from peak to residual. Strain is fixed: it is what the elastic energy loses.
        """
        for i in range(len(particles)):
            p = particles[i]
            own = total_stress(stress, insitu, p, p)
            xx, yy, zz, yz, xz, xy = judged_stress(stress, insitu, p, to_front, i)
            m = material[p]
            lame, shear = elastic_constants[m, 0], elastic_constants[m, 1]
            residual_row = strength_of(residual_rows, m, length)
            peak, residual, overshoot, seismic, _ = brittle_drop(
                law.return_to_surface, xx, yy, zz, yz, xz, xy, lame, shear, strength_of(intact_rows, m, length),
                residual_row, strength_at(strength_scale, p),
            )  # fmt: skip
            xx, yy, zz, yz, xz, xy = (
                residual[0] - to_front[i, 0],
                residual[1] - to_front[i, 1],
                residual[2] - to_front[i, 2],
                residual[3] - to_front[i, 3],
                residual[4] - to_front[i, 4],
                residual[5] - to_front[i, 5],
            )
            rxx, ryy, rzz, ryz, rxz, rxy, _ = law.return_to_surface(xx, yy, zz, yz, xz, xy, lame, shear, residual_row)
            after = (rxx, ryy, rzz, ryz, rxz, rxy)
            rest = strain_from_stress(lame, shear, xx - rxx, yy - ryy, zz - rzz, yz - ryz, xz - rxz, xy - rxy)
            energy[i] = 0.0
            for k in range(6):
                twice = 1.0 if k < 3 else 2.0  # shear stands twice in a tensor
                at_peak, at_end = peak[k] - to_front[i, k], residual[k] - to_front[i, k]
                energy[i, 0] += twice * 0.5 * ((own[k] + at_peak) * overshoot[k] + (at_end + after[k]) * rest[k])
                energy[i, 1] += twice * 0.5 * (at_peak + at_end) * seismic[k]
                overshoot_strain[p, k] = overshoot[k] + rest[k]
                seismic_strain[p, k] = seismic[k]
                stress[p, k] = after[k] - insitu[p, k]

    return drop


@functools.cache
def make_rate_strength(law):
    """The kernel for a law."""
    length = law.ROW_LENGTH

    @njit(parallel=True, error_model="numpy", cache=True)
    def rate_strength(
        particles, total_stress, material, intact_rows, residual_rows, strength_scale, failed, factor, excess
    ):
        """Strength factor and excess shear stress (particle,) of rock, against the strength it has now, written."""
        for i in prange(len(particles)):
            p = particles[i]
            row = strength_of(residual_rows if failed[p] else intact_rows, material[p], length)
            scale = 1.0 if failed[p] else strength_at(strength_scale, p)
            xx, yy, zz, yz, xz, xy = scaled(total_stress[p], 1.0 / scale)
            factor[p] = law.strength_factor(xx, yy, zz, yz, xz, xy, row)
            excess[p] = scale * law.excess_shear_stress(xx, yy, zz, yz, xz, xy, row)

    return rate_strength
