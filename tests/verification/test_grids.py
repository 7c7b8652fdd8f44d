"""Grids at equal error: interpolation and blocks by hand, and the study on its larger cells."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from running import run_study

from common.costs import Costs
from verification.answers.grids import at_error, difference, draw, make_rows, potency_by_block, read_runs, work
from verification.pages import answer_tables
from verification.tradeoff.runs import MIN_WORK

LARGER = [
    "sphere_regular_4", "sphere_regular_2", "sphere_boxes_2", "sphere_adaptive_4", "sphere_adaptive_2",
    "stope_regular_5", "stope_regular_2_5", "stope_boxes_2_5", "stope_adaptive_5", "stope_adaptive_2_5",
    "stope_walls_2_5",
]  # fmt: skip
DOMAIN = np.array([[0.0, 0.0, 0.0], [20.0, 10.0, 10.0]])


def state(positions, shear, volume=2.0) -> xr.Dataset:
    """Particles that failed in the last step with this seismic shear strain yz."""
    strain = np.zeros((len(positions), 6))
    strain[:, 3] = shear
    return xr.Dataset(
        {
            "position": (("particle", "axis"), np.array(positions, float)),
            "seismic_strain": (("particle", "voigt"), strain),
            "volume": ("particle", np.full(len(positions), volume)),
            "failed": ("particle", np.full(len(positions), 1)),
        },
        attrs={"step_index": 1},
    )


@given(
    st.floats(0.5, 3.0), st.floats(0.01, 100.0), st.lists(st.floats(1.5, 8.0), min_size=1, max_size=5), st.floats(0, 1)
)
def test_cost_at_an_error_is_that_of_a_power_law(order, factor, steps, share):
    """cost = factor * error^-order on any runs, and an error between the first and the last."""
    errors = 0.5 / np.cumprod([1.0, *steps])
    level = float(np.clip(errors[0] ** (1 - share) * errors[-1] ** share, errors[-1], errors[0]))
    found = at_error(level, errors, factor * errors**-order)
    np.testing.assert_allclose(found, factor * level**-order, rtol=1e-9)


def test_no_cost_is_given_beyond_the_runs():
    """Nothing is extrapolated; a single run has no line."""
    assert np.isnan(at_error(0.01, [0.3, 0.1], [10, 100]))
    assert np.isnan(at_error(0.5, [0.3, 0.1], [10, 100]))
    assert np.isnan(at_error(0.3, [0.3], [10]))


def test_potency_counts_where_it_is():
    """Moved within a block: no error. Into the next block: twice its share. Rock of other steps does not count."""
    here = state([[2, 5, 5], [12, 5, 5]], [1e-3, 3e-3])
    expected = potency_by_block(here, DOMAIN, 10.0)
    assert expected.shape == (2, 1, 1)
    within = state([[8, 1, 9], [12, 5, 5]], [1e-3, 3e-3])
    assert difference(potency_by_block(within, DOMAIN, 10.0), expected) == 0.0
    beyond = state([[12, 5, 5], [12, 5, 5]], [1e-3, 3e-3])
    np.testing.assert_allclose(difference(potency_by_block(beyond, DOMAIN, 10.0), expected), 0.5)
    less = state([[2, 5, 5], [12, 5, 5]], [1e-3, 1.5e-3])
    np.testing.assert_allclose(difference(potency_by_block(less, DOMAIN, 10.0), expected), 0.375)
    earlier = here.assign_attrs(step_index=2)
    assert potency_by_block(earlier, DOMAIN, 10.0).sum() == 0.0


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The study and its runs on cells of 2 to 5 m; boxes of 1.25 m are the reference."""
    found = run_study("grids", tmp_path_factory.mktemp("grids"), [*LARGER, "stope_boxes_1_25"])
    found.study.settings.update(reference="stope_boxes_1_25", equal={"sphere": [0.2], "stope": [0.4]})
    for variant in found.variants.values():
        variant.costs = lambda stage: Costs(90.0, 6.0 if stage == "steps/mined" else 2.0, 1.0, 300.0)
    return found, read_runs(found)


def test_cells_of_one_size_come_to_one_error_on_each_grid(study):
    """The rows of the sphere and of the stope, of which those of cells of 1 and 1.25 m are left out here."""
    results, runs = study
    rows = make_rows(results, runs)
    assert len(draw(runs).axes) == 4
    quantities = [row.quantity for row in rows]
    assert len(quantities) == len(set(quantities))
    same = [row for row in rows if row.quantity.endswith("error as on the regular grid, share")]
    assert len(same) == 6
    assert all(row.passed for row in same)
    for table in answer_tables("grids"):
        assert any(table.place({"quantity": quantity}) for quantity in quantities), table.title
    fewer = {row.quantity: row.obtained for row in rows if "cells over those of" in row.quantity}
    assert fewer["sphere, adaptive, 2 m: cells over those of regular"] < 0.05
    assert fewer["stope, adaptive, 2.5 m: cells over those of boxes"] < 1.0
    equal = {row.quantity: row.obtained for row in rows if " at " in row.quantity}
    for scene, level in (("sphere", 20), ("stope", 40)):
        saved = (equal[f"{scene} at {level} % error, cells, thousands: {grid}"] for grid in ("adaptive", "regular"))
        assert next(saved) < 0.5 * next(saved)


def test_a_grid_that_follows_walls_only_misses_failed_rock(study):
    """Its row of rock in coarse cells is reported, those of the other grids must be zero and are."""
    results, runs = study
    rows = make_rows(results, runs)
    coarse = {row.quantity.split(":")[0]: row for row in rows if "coarse cells" in row.quantity}
    walls = coarse.pop("stope, walls, 2.5 m")
    assert walls.obtained > 0.05
    assert walls.passed is None
    assert coarse
    assert all(row.passed for row in coarse.values())
    errors = {run.grid: run.error for run in runs if (run.scene, run.cell) == ("stope", 2.5)}
    assert errors["walls"] > 1.3 * errors["adaptive"]


def test_processor_time_leaves_out_compiling_and_starts(study):
    """Stages of 1, 1 and 5 s without compiling; the quickest bounds the start of a process."""
    _, runs = study
    times = {run.scene: work(run, runs) for run in runs}
    assert times == {"sphere": MIN_WORK, "stope": 4.0}
