"""grid.failure_zone: a draft run finds where rock will fail, and the grid is fine there."""

import numpy as np
import pytest
import xarray as xr
from tiny_mines import FLAT, NEXT_STEP, STILL, TINY, changed, merged

from mpm_core.gridding import Domain, failure_zone, make_grid
from mpm_core.scene import parse_scene
from mpm_core.stages import elastic_stage, mining_step
from workflow.configuration import load
from workflow.draft import draft_of
from workflow.mine import Mine

AUTO = {"grid.failure_zone": "auto"}
ALONE = {key: value for key, value in TINY.items() if key != "record"}


def mine_of(mine: dict, **changes) -> Mine:
    return load(merged(changed(mine, **AUTO, **changes)), "tiny.yaml")


def run(mine: Mine, grid: xr.Dataset, tmp_path) -> list[xr.Dataset]:
    """States of all steps."""
    state = elastic_stage(parse_scene(mine.scene_slice(0)), grid, tmp_path / "failed.npz")[0]
    states = []
    for step in mine.mined_steps:
        state = mining_step(parse_scene(mine.step_slice(step)), grid, state, tmp_path / "failed.npz")[0]
        states.append(state)
    return states


def test_pressure_on_walls_follows_the_steps_of_the_draft():
    """History's steps keep their own; of all later ones, which come together, the last counts."""
    later = {"excavations.0.pressure": {"2019-09": "1 MPa", "history": "5 MPa", "2019-08": "2 MPa"}}
    draft = draft_of(mine_of(ALONE, **later, steps=[*TINY["steps"], NEXT_STEP]))
    assert draft.mined_steps == ["draft-0", "draft-1"]
    assert draft.step_slice("draft-1")["excavations"][0]["pressure"] == [[0, 5e6], [1, 1e6]]


def test_the_draft_is_two_levels_coarser_and_mines_everything():
    mine = mine_of(ALONE, **{"grid.levels": 4})
    draft = draft_of(mine)
    assert (mine.values["grid"]["levels"], draft.values["grid"]["levels"]) == (4, 2)
    assert draft.mined_steps == ["draft-0", "draft-1"]
    mined = [entry["mined"] for entry in draft.step_slice("draft-1")["excavations"]]
    assert mined == [0, 1, 1]  # the planned stope too
    assert parse_scene(draft.step_slice("draft-1")).draft
    assert not parse_scene(mine.step_slice("2019-08")).draft
    assert draft_of(draft) is None


def test_a_planned_stope_that_gets_its_month_changes_neither_draft_nor_grid():
    before = mine_of(ALONE)
    after = mine_of(ALONE, **{"excavations.2.step": "2019-09", "steps": [*TINY["steps"], NEXT_STEP]})
    assert after.mined_steps != before.mined_steps
    assert after.grid_slice() == before.grid_slice()
    old, new = draft_of(before), draft_of(after)
    assert new.mined_steps == old.mined_steps
    for step in old.mined_steps:
        assert new.step_slice(step) == old.step_slice(step)


@pytest.mark.parametrize(
    ("mine", "changes"),
    [
        (ALONE, {"grid.failure_zone": "none"}),
        (ALONE, {"grid.levels": 1}),
        (STILL, {}),  # no step, nothing fails
    ],
)
def test_no_draft_where_none_is_wanted_or_nothing_can_be_refined(mine, changes):
    assert draft_of(load(merged(changed(mine, **(AUTO | changes))), "tiny.yaml")) is None


def test_the_zone_covers_failed_cells_of_every_size_and_nothing_else():
    domain = Domain(np.array([100.0, 0.0]), np.array([4, 4]), 8.0, 4)  # draft cells: 8 m and 4 m
    draft = xr.Dataset(
        {
            "failed": ("particle", [0, -1, 1]),
            "position": (("particle", "xyz"), [[104.0, 0.0, 4.0], [110.0, 0.0, 2.0], [130.0, 0.0, 30.0]]),
            "spacing": ("particle", [8.0, 4.0, 4.0]),
        }
    )
    zone = failure_zone(draft, domain, (0, 2))
    assert zone.level == 1
    assert {tuple(index) for index in zone.index.tolist()} == {(0, 0), (0, 1), (1, 0), (1, 1), (7, 7)}


def test_rock_that_fails_in_the_draft_can_fail_on_the_grid(tmp_path):
    """A drive in weak rock: with fine cells at the wall only, coarse cells hold overstressed rock; in the zone none do.

    The draft's cells (5 m) must be smaller than the drive (12 m wide), else it sees no stress concentration.
    """
    fine = {"grid.coarse_cell": "5 m", "grid.levels": 3, "grid.buffer_cells": 0}
    mine = mine_of(FLAT, **fine, **{"materials.host.cohesion": {"intact": "3 MPa", "residual": "1.5 MPa"}})
    draft = draft_of(mine)
    found = run(draft, make_grid(draft.grid_slice(), {}), tmp_path)[-1]
    assert (found.failed.values >= 0).any()
    narrow, wide = make_grid(mine.grid_slice(), {}), make_grid(mine.grid_slice(), {}, found)
    assert run(mine, narrow, tmp_path)[-1].attrs["truncated_share"] > 0.1
    assert run(mine, wide, tmp_path)[-1].attrs["truncated_share"] == 0.0
    center = wide.cell_origin.values + 0.5 * wide.cell_size.values[:, None] * [1, 0, 1]
    failed = found.isel(particle=found.failed.values >= 0)
    for place, size in zip(failed.position.values, failed.spacing.values, strict=True):
        inside = (np.abs(center - place)[:, [0, 2]] < 0.5 * size).all(axis=1)
        assert (wide.cell_level.values[inside] == 2).all()
