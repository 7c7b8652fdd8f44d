"""Fill between walls that stood apart: in which openings it holds nothing."""

from mechanics.scenes import excavation, make_scene
from mechanics.test_grid_stage import block, grid_slice
from mpm_core.files.state_datasets import read_grid
from mpm_core.model.occupancy import Unsupported
from mpm_core.stages.grid_stage import make_grid
from mpm_core.stages.ground import Ground

# Cells of 2 m. Of two stopes 1.2 cells thick each wall lies in a cell next to that of the other; one is four cells
# thick, with its walls on faces of cells.
THIN, AT_ONCE = ([3.5, 4.0, 4.0], [5.9, 10.0, 20.0]), ([3.5, 14.0, 4.0], [5.9, 20.0, 20.0])
WIDE = ([12.0, 4.0, 4.0], [20.0, 20.0, 20.0])


def test_fill_that_comes_after_its_opening_stood_open_is_named_where_it_holds_nothing():
    """Once it is placed; not before, not where it came at once, not in a wide opening."""
    boxes = [block(*corners, name) for name, corners in (("thin", THIN), ("at_once", AT_ONCE), ("wide", WIDE))]
    grid = make_grid(grid_slice(*boxes, coarse_cell=4.0), {})
    entries = [
        excavation(0, "fill", 1, "thin"),
        excavation(0, "fill", 0, "at_once"),
        excavation(0, "fill", 1, "wide"),
    ]
    ground = Ground.of(make_scene(excavations=entries, steps=2), grid)
    model = ground.model(*read_grid(grid), Unsupported.none(), all_fallen=True, at=0)
    assert model.unheld_fill(0) == {}
    found = model.at(1).unheld_fill(1)
    assert list(found) == ["thin"]
    assert found["thin"] == len(model.at(1).unheld) > 10
