"""Bands of failed rock along the grid: directions, mirror images, and how often the check errs on drawn truths."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from catalogs.compare.bands import GridPreference, band_normals, bands_of, grid_preference
from common.voigt import voigt_from_tensor

CELL = 2.0


def sheet(normal, center=(0.0, 0.0, 0.0), extent=12):
    """Centres of cells within half a cell of a square plane piece, extent cells across."""
    axis = np.arange(-extent, extent + 1)
    index = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    near = np.abs(index @ normal) <= 0.5 * np.abs(normal).max()
    inside = np.linalg.norm(index, axis=1) <= 0.5 * extent
    return CELL * (index[near & inside] + np.round(np.asarray(center) / CELL))


def normal_at(angle, turn=0.0):
    """Unit normal at an angle from z, degrees, turned about z."""
    a, b = np.radians([angle, turn])
    return np.array([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)])


@pytest.mark.parametrize("angle", [0.0, 20.0, 45.0, 70.0])
def test_the_normal_of_a_plane_of_cells_is_found(angle):
    normal = normal_at(angle, 25.0)
    place = sheet(normal)
    chosen, found = band_normals(place, CELL)
    middle = np.linalg.norm(place[chosen], axis=1) < 4 * CELL
    off = np.degrees(np.arccos(np.clip(np.abs(found[middle] @ normal), 0, 1)))
    assert middle.sum() > 20
    assert off.max() < 10.0


def test_a_full_body_has_no_bands():
    axis = CELL * np.arange(12.0)
    place = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    chosen, _ = band_normals(place, CELL)
    inner = ((place > 6.0) & (place < 16.0)).all(axis=1)
    assert not inner[chosen].any()
    assert [len(one) for one in band_normals(np.empty((0, 3)), CELL)] == [0, 0]


def conjugate(normal, between=60.0):
    """Strain whose two planes of shear are at this angle, degrees, one of them with this normal; and the other normal.

    T lies at half the angle from both normals' bisector in a plane through the normal.
    """
    aside = np.cross(normal, [0.3, 0.5, 0.81])
    aside /= np.linalg.norm(aside)
    half = np.radians(0.5 * between)
    pressure = np.cos(half) * normal + np.sin(half) * aside  # between both normals
    tension = -np.sin(half) * normal + np.cos(half) * aside
    strain = np.outer(tension, tension) - np.outer(pressure, pressure)
    return strain, normal - 2.0 * (normal @ tension) * tension


def of(normal, strain, **options):
    place = sheet(normal, **options)
    return grid_preference(place, np.broadcast_to(strain, (len(place), 3, 3)), CELL)


def test_bands_along_the_grid_and_their_mirror_images_are_told_apart():
    """The same two planes: one along cells, the other not. A plane that opens is its own mirror image."""
    strain, other = conjugate(np.array([0.0, 0.0, 1.0]))
    along, mirrored = of(np.array([0.0, 0.0, 1.0]), strain), of(other, strain)
    assert along.along.sum() > 20
    assert len(along.along) == 1
    assert len(along.mirrored) == 0
    assert len(mirrored.along) == 0
    assert mirrored.mirrored.sum() > 10
    for tilt in (0.0, 5.0, 12.0):  # a skin that opens is nearly its own mirror image
        tension = normal_at(tilt)
        opens = of(np.array([0.0, 0.0, 1.0]), 1.5 * np.outer(tension, tension) - 0.5 * np.eye(3))
        assert len(opens.along) + len(opens.mirrored) == 0


@given(st.permutations([0, 1, 2]), st.tuples(*[st.sampled_from([-1.0, 1.0])] * 3), st.integers(0, 10**6))
def test_axes_that_change_places_or_signs_change_nothing(order, signs, seed):
    strain, _ = conjugate(np.array([0.0, 0.0, 1.0]))
    place = sheet(np.array([0.0, 0.0, 1.0]))
    turn = np.eye(3)[order] * signs
    shuffled = np.random.default_rng(seed).permutation(len(place))
    moved = place[shuffled] @ turn.T + 7 * CELL
    found = grid_preference(moved, np.broadcast_to(turn @ strain @ turn.T, (len(place), 3, 3)), CELL)
    first = of(np.array([0.0, 0.0, 1.0]), strain)
    assert found.along.tolist() == first.along.tolist()
    assert found.mirrored.tolist() == first.mirrored.tolist()


def test_particles_of_one_cell_count_as_one():
    """Eight in each cell of a sheet: the same bands as with one."""
    strain, _ = conjugate(np.array([0.0, 0.0, 1.0]))
    place = sheet(np.array([0.0, 0.0, 1.0]))
    corners = 0.25 * CELL * (np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1], indexing="ij"), axis=-1).reshape(-1, 3))
    found = []
    for shifts in (np.zeros((1, 3)), corners):
        count = len(shifts)
        position = (place[:, None] + shifts).reshape(-1, 3)
        shuffled = np.random.default_rng(1).permutation(len(position))
        cell = np.repeat(np.arange(len(place)), count)
        state = xr.Dataset(
            {
                "position": (("particle", "xyz"), position[shuffled]),
                "cell": ("particle", cell[shuffled]),
                "failed": ("particle", np.zeros(len(position), np.int32)),
                "volume": ("particle", np.ones(len(position))),
                "plastic_strain": (("particle", "voigt"), np.tile(voigt_from_tensor(strain), (len(position), 1))),
            }
        )
        found.append(bands_of(state, CELL))
    assert found[0].along.sum() > 20
    assert found[1].along.tolist() == found[0].along.tolist()
    assert found[1].mirrored.tolist() == found[0].mirrored.tolist()


def drawn(random, bands, share):
    """Bands of heavy-tailed sizes, each along the grid with this chance."""
    size = np.ceil(3.0 * random.pareto(1.2, bands) + 1.0).astype(int)
    lies = random.random(bands) < share
    return GridPreference(size[lies], size[~lies])


def test_the_check_seldom_errs_where_the_grid_has_no_say_and_mostly_sees_where_it_has():
    """Right truths: equal choice, and 1.25 times as often along the grid. Wrong: always, and four times as often."""
    random = np.random.default_rng(5)

    def told(share, bands, draws=300):
        return np.mean([drawn(random, bands, share).is_told for _ in range(draws)])

    for bands in (1, 3, 10, 40):
        assert told(0.5, bands) < 0.1
        assert told(1.25 / 2.25, bands) < 0.15  # at the bound itself it is 0.1
    assert told(1.0, 3) == 0.0  # too few to say, whatever they do
    assert told(1.0, 10) > 0.9
    assert told(0.8, 40) > 0.6
    assert not GridPreference(np.empty(0, int), np.empty(0, int)).is_told
