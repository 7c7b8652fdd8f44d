"""`accuracy`: what a preset changes of a mine, and what it leaves."""

import pytest
from tiny_mines import TINY, box

from common.errors import InputError
from mpm_core.scene.scene import parse_scene
from mpm_core.settings import GridSlice
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
from mpm_core.stages.grid_stage import compare_volumes, make_grid


def test_what_a_file_says_is_standard(accept):
    plain, said = accept(TINY), accept(TINY, accuracy="standard")
    assert plain.settings == said.settings
    assert (plain.settings.grid.levels, plain.settings.solver.tolerance) == (2, 1e-3)


def test_a_draft_has_larger_cells_looser_tolerances_and_fewer_increments(accept):
    mine = accept(TINY, accuracy="draft", **{"solver.increments": 5, "solver.cascade_tolerance": 1e-4})
    grid, solver = mine.settings.grid, mine.settings.solver
    assert (grid.levels, grid.coarse_cell) == (1, 10.0)
    assert (solver.increments, solver.max_overshoot) == (3, 0.4)
    assert [solver.tolerance, solver.cascade_tolerance] == pytest.approx([3e-3, 3e-4])
    loose = accept(TINY, accuracy="draft", **{"solver.tolerance": 0.05, "solver.increments": 0})
    assert (loose.settings.solver.tolerance, loose.settings.solver.increments) == (0.05, 0)


def test_a_fine_one_has_smaller_cells_and_more_increments(accept):
    mine = accept(TINY, accuracy="fine")
    grid, solver = mine.settings.grid, mine.settings.solver
    assert (grid.levels, solver.tolerance, solver.increments, solver.max_overshoot) == (3, 1e-3, 4, 0.1)
    assert mine.settings.domain == accept(TINY).settings.domain
    assert accept(TINY, accuracy="fine").catalogue_slice() == accept(TINY).catalogue_slice()


def test_cells_that_cannot_change_are_refused_with_what_would_let_them(refuse):
    """As they are, given by levels or not: sides of 80 m are no multiples of twice 80 m."""
    line = refuse(TINY, accuracy="draft", **{"grid.levels": 1})
    assert line.startswith(
        "accuracy: draft: leaves out the finest cells, but all cells are of 10 m; make sides of the domain"
    )
    assert refuse(TINY, accuracy="draft", grid={"finest_cell": "80 m"}).endswith(
        "whole multiples of 160 m and the largest cells (grid) as large, or leave accuracy out"
    )
    line = refuse(TINY, accuracy="fine", **{"grid.levels": 12})
    assert line.startswith("accuracy: fine: halves the finest cells, but there are 12 sizes of cell, the most")


def test_a_finest_cell_is_that_of_standard(accept):
    standard, draft = (
        accept(TINY, **{"grid": {"finest_cell": "5 m", "buffer_cells": 1}, "accuracy": name})
        for name in ("standard", "draft")
    )
    assert standard.convergence_slice()["cells"][0] == 5.0
    assert draft.convergence_slice()["cells"][0] == 10.0


DRAFT = r"10 m \(accuracy: draft doubles those of the file; leave it out to have them\)"


def drive(side: float) -> dict:
    """The tiny mine with nothing but a drive of this width and height."""
    mine = {key: value for key, value in TINY.items() if key != "record"}
    return mine | {"excavations": [box("drive", "history", [20, 30, 40], [60, 30 + side, 40 + side])], "steps": []}


def test_a_draft_keeps_the_file_s_cells_where_a_drive_needs_them(accept):
    """A drive of 5 m fills cells of 5 m, and none of 10 m. The steps follow the rock as those of the file do."""
    mine = accept(drive(5.0), accuracy="draft")
    assert mine.is_adaptive
    kept = make_grid(mine.grid_slice(), {})
    assert (kept.attrs["fine_cell"], kept.attrs["draft_would_lose"]) == (5.0, '["drive"]')


def test_a_draft_of_two_sizes_of_cell_ends(accept, tmp_path):
    """It has one size left, whose cells nothing can split, and rock that fails."""
    mine = accept({key: value for key, value in TINY.items() if key != "record"}, accuracy="draft")
    grid = make_grid(mine.grid_slice(), {})
    state, _ = elastic_stage(parse_scene(mine.mechanics_slice(0)), grid, tmp_path / "failed.npz")
    for number in range(len(mine.mined_steps)):
        state, facts = mining_step(parse_scene(mine.mechanics_slice(number)), grid, state, tmp_path / "failed.npz")
    assert grid.attrs["levels"] == 1
    assert facts["failed_volume"] > 0.0
    assert facts["truncated_share"] == 0.0


@pytest.mark.parametrize(
    ("side", "said"),
    [
        (4.0, "excavations: too narrow for cells of {}: 0 % of their volume"),
        (0.4, "excavations.drive: adds no volume: .* than a fraction of the finest cell, {}; use smaller"),
    ],
)
def test_what_refuses_cells_says_that_a_preset_has_resized_them(accept, side, said):
    with pytest.raises(InputError, match=said.format(DRAFT)):
        make_grid(accept(drive(side), accuracy="draft").grid_slice(), {})
    with pytest.raises(InputError, match=said.format("5 m")):
        make_grid(accept(drive(side)).grid_slice(), {})
    fine = GridSlice.of(accept(TINY, accuracy="fine").grid_slice()).grid
    with pytest.raises(InputError, match=r"of 2\.5 m \(accuracy: fine halves those of the file; leave it out"):
        compare_volumes("drive", 100.0, 10.0, fine)
