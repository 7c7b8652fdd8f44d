"""What each excavation mines on the grid, against closed volumes of its solids and against the mechanics."""

import json

import numpy as np
import pytest
from mechanics.scenes import excavation, make_scene
from mechanics.test_grid_stage import block, grid_slice

from catalogs.sources.openings import FILL, NEVER, ROCK, Mining
from common.errors import InputError
from mpm_core.files.state_datasets import read_grid, read_pieces
from mpm_core.model.occupancy import Unsupported
from mpm_core.stages.grid_stage import make_grid
from mpm_core.stages.ground import Ground

# Walls lie at odd places, so that nodes of the cells of 2 m are moved onto edges.
PIT, PUSHBACK = ([5.3, 5.1, 8.2], [12.7, 18.9, 17.6]), ([4.1, 4.3, 4.4], [17.3, 19.7, 17.7])
DRIVE, PILLAR = ([11.1, 2.3, 6.3], [13.9, 21.7, 9.2]), ([6.2, 6.1, 9.3], [9.1, 17.2, 13.4])
LATER = ([15.2, 6.3, 6.1], [21.7, 14.9, 12.4])
BOXES = {"pushback": PUSHBACK, "pit": PIT, "drive": DRIVE, "pillar": PILLAR, "later": LATER}
MINED, FILLED = np.array([2, 0, 1, 3, NEVER]), np.array([2, NEVER, NEVER, NEVER, NEVER])
RESOLUTION = 0.02  # Share of a solid's volume that walls across cells may miss: a 64th of a cell at a wall.


def volume(*boxes) -> float:
    """Volume that boxes (lower, upper) share."""
    lower, upper = (np.array(corners) for corners in zip(*boxes, strict=True))
    return float(np.prod(np.clip(upper.min(axis=0) - lower.max(axis=0), 0.0, None)))


def of_pushback() -> float:
    """Rock of the pushback alone: without the pit and the drive, which are mined before."""
    without = volume(PUSHBACK, PIT) + volume(PUSHBACK, DRIVE) - volume(PUSHBACK, PIT, DRIVE)
    return volume(PUSHBACK) - without


@pytest.fixture(scope="module")
def grid():
    """A pit inside a pushback, a drive through both, fill that is mined again, and a planned opening."""
    boxes = [block(*corners, name) for name, corners in BOXES.items()]
    return make_grid(grid_slice(*boxes, coarse_cell=4.0), {})


def test_each_excavation_mines_what_no_earlier_one_has(grid):
    """Closed volumes: the drive without the pit, the pushback without both, the pillar none of rock but all of fill."""
    assert grid.sizes["edge_node"] > 20
    mining = Mining.of(grid, MINED, FILLED)
    rock = [of_pushback(), volume(PIT), volume(DRIVE) - volume(DRIVE, PIT), 0.0, 0.0]
    np.testing.assert_allclose(mining.volumes(ROCK), rock, rtol=RESOLUTION)
    np.testing.assert_allclose(mining.volumes(FILL), [0.0, 0.0, 0.0, volume(PILLAR), 0.0], rtol=RESOLUTION)
    by_shares = np.bincount(grid["piece_excavation"], grid["piece_fraction"] * 8.0)
    assert abs(by_shares[3] / volume(PILLAR) - 1.0) > 3 * RESOLUTION  # undistorted cells would miss it


def test_volumes_of_pieces_are_those_of_the_solids_on_the_grid(grid):
    """Mined alone, each has the volume that the grid states for its solid, to the last bit but rounding."""
    on_grid = json.loads(grid.attrs["excavation_volume_grid"])
    assert on_grid == pytest.approx([volume(corners) for corners in BOXES.values()], rel=RESOLUTION)
    for number in range(len(BOXES)):
        alone = Mining.of(grid, np.where(np.arange(5) == number, 0, NEVER), np.full(5, NEVER))
        assert alone.volumes(ROCK)[number] == pytest.approx(on_grid[number], rel=1e-12)


def test_the_mechanics_lose_the_same_rock_in_each_step(grid):
    """The volume of all rock before each step less that after it; a remainder of one sample goes with the rest."""
    steps = 4
    entries = [
        excavation(int(mined), "fill" if filled < NEVER else None, int(filled), name)
        for name, mined, filled in zip(BOXES, np.where(MINED < NEVER, MINED, -1), FILLED, strict=True)
    ]
    ground = Ground.of(make_scene(excavations=entries, steps=steps), grid)
    model = ground.model(*read_grid(grid), Unsupported.none(), all_fallen=True)
    rock = model.particles.is_rock
    left = [model.material_volumes(step)[rock].sum() for step in range(steps)]
    mined = -np.diff([model.particles.full_volume[rock].sum(), *left])
    mining = Mining.of(grid, MINED, FILLED)
    by_step = [mining.volumes(ROCK)[MINED == step].sum() for step in range(steps)]
    np.testing.assert_allclose(mined, by_step, rtol=3e-3, atol=1e-9)


def test_pieces_are_whole_again_when_they_are_read(grid):
    """Excavations that overlap are divided in the file: parts of a cell are the same or have nothing in common."""
    pieces = read_pieces(grid)
    assert len(np.unique(np.column_stack([pieces.place, pieces.excavation]), axis=0)) == len(pieces.place)
    assert grid.sizes["piece"] > len(pieces.place)
    parts = {}
    for place, samples in zip(grid["piece_origin"].values.tolist(), grid["piece_samples"].values.tolist(), strict=True):
        parts.setdefault(tuple(place), set()).add(samples)
    for own in parts.values():
        assert (
            sum(one.bit_count() for one in own) == int(np.bitwise_or.reduce(np.array(list(own), np.uint64))).bit_count()
        )


def test_cells_belong_to_the_excavation_that_mined_there_last(grid):
    """The pit's cells stay its own when the pushback reaches them; the pillar takes over what it mines of the fill."""
    mining = Mining.of(grid, MINED, FILLED)
    middle = np.array([8.0, 10.0, 10.0])  # lower corner of a cell in pit, pushback and pillar
    owners = []
    for step in range(4):
        origin, excavation_of = mining.cells_open(step)
        owners.append(set(excavation_of[(origin == middle).all(axis=1)].tolist()))
    assert owners[:3] == [{1}, {1}, {1}]
    assert 3 in owners[3]
    drawn = mining.first_mined(grid)
    assert set(drawn["piece_excavation"].values.tolist()) == {0, 1, 2}
    assert float(drawn["piece_volume"].sum()) == pytest.approx(mining.volumes(ROCK).sum())


def test_a_grid_of_an_earlier_version_is_refused(grid):
    with pytest.raises(InputError, match=r"grid\.nc was made by an earlier version"):
        Mining.of(grid.drop_vars("piece_volume"), MINED, FILLED)
