"""Openings too narrow for their cells: how much of each stands in whole cells, and what is refused."""

import json
import logging

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.errors import InputError
from mechanics.test_grid_stage import block, grid_slice
from mpm_core.model.occupancy import ALL_SAMPLES, FinestPieces
from mpm_core.stages.grid_stage import make_grid, whole_shares

SHAPE = np.array([3, 4])
LEFT, RIGHT = np.uint64(2**32 - 1), np.uint64(2**64 - 2**32)


@st.composite
def mined(draw):
    """Parts of a few cells in a few excavations, each cell at most once in each, and which of these come later."""
    count = draw(st.integers(1, 4))
    rows = [
        (place, excavation, draw(st.sampled_from([ALL_SAMPLES, LEFT, RIGHT, np.uint64(7)])))
        for excavation in range(count)
        for place in sorted(draw(st.sets(st.sampled_from([(0, 0), (0, 1), (2, 3), (1, 2)]))))
    ]
    later = np.array(draw(st.lists(st.booleans(), min_size=count, max_size=count)))
    return rows, later


@settings(max_examples=200, deadline=None)
@given(mined(), st.randoms(use_true_random=False))
def test_share_in_whole_cells_is_that_of_a_count_sample_by_sample(drawn, random):
    """Cell by cell: whole for those of the first step where these fill it, for later ones where all together do."""
    rows, later = drawn
    expected = np.zeros(len(later))
    for number in range(len(later)):
        own = [(place, samples) for place, excavation, samples in rows if excavation == number]
        inside = 0
        for place, samples in own:
            union = 0
            for other, excavation, others in rows:
                if other == place and (later[number] or not later[excavation]):
                    union |= int(others)
            inside += int(samples).bit_count() if union == int(ALL_SAMPLES) else 0
        size = sum(int(samples).bit_count() for _, samples in own)
        expected[number] = inside / size if size else 0.0
    random.shuffle(rows)
    parts = FinestPieces(
        np.array([row[0] for row in rows], np.int32).reshape(-1, 2),
        np.array([row[1] for row in rows], np.int16),
        np.array([row[2] for row in rows], np.uint64),
    )
    np.testing.assert_allclose(whole_shares(parts, SHAPE, later), expected, rtol=1e-14)


def test_openings_that_fill_no_cell_are_refused_unless_cells_are_in_or_out():
    """A slot as high as a cell, a quarter of a cell off the cells: each of its cells keeps a quarter of rock or more,
    which would hold the slot open. Where a companion on larger cells is asked for, it is told what it is."""
    slot = block([4.0, 4.0, 9.0], [20.0, 20.0, 13.0], "slot")
    with pytest.raises(InputError, match=r"excavations: too narrow for cells of 4 m: 0 % .*cut_cells: whole"):
        make_grid(grid_slice(slot), {})
    whole = make_grid(grid_slice(slot, cut_cells="whole"), {})
    assert json.loads(whole.attrs["excavation_whole_share"]) == [1.0]
    companion = make_grid(grid_slice(slot, volume_error=1e9), {})
    assert json.loads(companion.attrs["excavation_whole_share"]) == [0.0]


def test_a_narrow_opening_beside_a_wide_one_is_named_not_refused(caplog):
    wide, narrow = block([4.0] * 3, [15.0] * 3, "stope"), block([17.0, 4.0, 4.0], [20.0, 20.0, 7.0], "drive")
    with caplog.at_level(logging.WARNING):
        grid = make_grid(grid_slice(wide, narrow), {})
    whole, none = json.loads(grid.attrs["excavation_whole_share"])
    assert whole > none == 0.0
    assert [record.message for record in caplog.records if "narrow" in record.message] == [
        "stope: narrow for cells of 4 m: 2.7 across it, of 3 that it needs; use cells of 3.6 m or less",
        "drive: narrow for cells of 4 m: 0.7 across it, of 3 that it needs; use cells of 1 m or less",
    ]
    assert json.loads(grid.attrs["excavation_narrow"]) == ["stope", "drive"]


@pytest.mark.parametrize("later", [[], [1]])
def test_a_draft_keeps_the_cells_that_an_opening_needs(caplog, later):
    """Of cells of 8 m none lies in a drive of 4 x 4 m, of cells of 4 m all of them do; the stope fits both."""
    stope, drive = block([8.0] * 3, [16.0, 24.0, 24.0], "stope"), block([4.0] * 3, [8.0, 20.0, 8.0], "drive")

    def draft(*excavations, **more):
        return make_grid(
            grid_slice(*excavations, levels=1, resized_by="draft", **more) | {"later": later[: len(excavations) - 1]},
            {},
        )

    with caplog.at_level(logging.WARNING):
        kept = draft(stope, drive)
    assert [text for text in caplog.messages if "narrow" not in text] == [
        "accuracy: draft keeps cells of 4 m: hardly any cell of twice that size would lie wholly in drive"
    ]
    assert json.loads(kept.attrs["draft_would_lose"]) == ["drive"]
    standard = make_grid(grid_slice(stope, drive) | {"later": later}, {})
    assert kept.identical(standard.assign_attrs(draft_would_lose='["drive"]'))
    assert draft(stope).attrs["fine_cell"] == draft(stope, drive, volume_error=1.0).attrs["fine_cell"] == 8.0
