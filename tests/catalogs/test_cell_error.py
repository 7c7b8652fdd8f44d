"""How thick failed rock is in cells, and the error that the cells leave in it: the law against the study's runs."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from catalogs.compare.cell_error import (
    COVERAGE,
    ERROR_AT_ONE_CELL,
    ERROR_ORDER,
    MAX_ERROR,
    MIN_ERROR,
    error_at,
    failed_thickness,
)
from catalogs.compare.grid_convergence import cell_error
from verification import cell_errors
from verification.studies import FOLDER, load_study


def state(solid: np.ndarray, failed: np.ndarray, cell: float = 2.0) -> xr.Dataset:
    """State on a block of cells: those of rock and those failed (x, y, z); a coarse cell lies beside the block."""
    where = np.argwhere(solid)
    origin, size = np.vstack([cell * where, [[-4 * cell] * 3]]), np.full(len(where) + 1, cell)
    size[-1] = 4 * cell
    step = np.append(np.where(failed[solid], 3, -1), 3)
    particles = {"cell": ("particle", np.arange(len(size))), "failed": ("particle", step)}
    return xr.Dataset({"cell_origin": (("cell", "xyz"), origin), "cell_size": ("cell", size)} | particles)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("thick", [1, 2, 5])
def test_a_layer_is_as_thick_as_its_cells(axis, thick):
    """Over a wall, an opening below it; its edges end at openings, too."""
    height = np.moveaxis(np.broadcast_to(np.arange(8), (6, 7, 8)), 2, axis)
    solid, failed = height > 0, (height > 0) & (height <= thick)
    assert failed_thickness(state(solid, failed), [3]) == pytest.approx(thick)
    assert failed_thickness(state(solid, failed, 0.5), [2, 3]) == pytest.approx(thick)
    assert np.isnan(failed_thickness(state(solid, failed), [2]))
    assert failed_thickness(state(failed, failed), [3]) == np.inf


def test_a_shell_around_a_spherical_opening_is_as_thick_as_its_volume_over_its_projections():
    """Faces of cells show three times the area of a sphere's projections, a half more than its surface: two thirds of
    the thickness of a layer of the same volume over its outer surface."""
    radius = np.linalg.norm(np.stack(np.meshgrid(*3 * [np.arange(41) - 20.0], indexing="ij")), axis=0)
    solid, failed = radius > 8.0, (radius > 8.0) & (radius <= 12.0)
    exact = (12.0**3 - 8.0**3) / (3 * 12.0**2) * 2 / 3
    assert failed_thickness(state(solid, failed), [3]) == pytest.approx(exact, rel=0.03)


@given(st.floats(0.1, 20.0), st.floats(0.1, 20.0))
def test_thicker_zones_are_never_more_uncertain(first, second):
    assert error_at(min(first, second)) >= error_at(max(first, second)) >= MIN_ERROR


def test_nothing_that_failed_has_no_uncertainty():
    assert np.isnan(error_at(np.nan))
    assert error_at(np.inf) == MIN_ERROR


# ---- against study openings ----


@pytest.fixture(scope="module")
def errors() -> list[cell_errors.CellError]:
    """Of the study's runs."""
    scenes = load_study(FOLDER / "openings.yaml").settings["scenes"]
    return cell_errors.cell_errors(cell_errors.read_table(), scenes)


def test_the_constants_are_those_of_the_study(errors):
    """To the digits that they have; `python -m verification.cell_errors` prints them."""
    law = cell_errors.fit(errors)
    assert [float(f"{value:.2g}") for value in law] == [ERROR_AT_ONE_CELL, ERROR_ORDER, MIN_ERROR]


def kept_out(errors: list[cell_errors.CellError], sizes: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Errors of runs with these sizes of cells, and the uncertainty by a law that is fitted without their mine."""
    size, stated = [], []
    for mine in {one.mine for one in errors}:
        law = cell_errors.fit(one for one in errors if one.mine != mine)
        judged = [one for one in errors if one.mine == mine and one.size in sizes]
        size += [abs(one.error) for one in judged]
        stated += law.at(np.array([one.thickness for one in judged])).tolist()
    return np.array(size), np.array(stated)


def test_of_mines_that_the_law_does_not_know_it_covers_nine_runs_of_ten(errors):
    """Of standard and fine, of which reports state it; each mine judged by the law of the other eight."""
    assert {one.mine for one in errors} == set(load_study(FOLDER / "openings.yaml").settings["scenes"])
    size, stated = kept_out(errors, (cell_errors.STANDARD, cell_errors.FINE))
    assert len(size) > 8 * 4 * 2
    assert np.mean(size > stated) <= 1.0 - COVERAGE
    assert np.median(stated) < 0.15 < MAX_ERROR


def test_a_change_is_called_unexpected_in_one_mine_of_ten_at_most_and_wherever_the_law_fails():
    """Errors of both sizes of cells are drawn from the law; then doubled cells are off by three times as much."""
    generator, thickness = np.random.default_rng(2), (2.0, 1.0)
    widths = [error_at(one) for one in thickness]
    draws = generator.standard_normal((2000, 2)) * widths / norm.ppf(0.5 + 0.5 * COVERAGE)
    wrong = draws + np.array([0.0, 3.0 * sum(widths)])
    shares = [
        np.mean([cell_error(np.exp(one), thickness, lost=False) > np.expm1(widths[0]) * 1.000001 for one in some])
        for some in (draws, wrong)
    ]
    assert shares[0] <= 1.0 - COVERAGE
    assert shares[1] >= 0.99


def test_law_is_found_from_errors_that_are_drawn_from_it():
    generator = np.random.default_rng(1)
    drawn = []
    for size, low, high in (("draft", 0.5, 1.0), ("standard", 1.0, 1.5), ("fine", 2.0, 3.0)):
        for thickness in generator.uniform(low, high, 400):
            scale = 0.2 * thickness**-3 if size != "fine" else 0.03
            error = scale * generator.uniform(-1.0, 1.0)
            drawn.append(cell_errors.CellError("mine", "", size, "potency", float(thickness), float(error)))
    law = cell_errors.fit(drawn)
    assert law.at_one_cell == pytest.approx(cell_errors.FITTED_SHARE * 0.2, rel=0.1)
    assert law.order == pytest.approx(3.0, rel=0.1)
    assert law.least == pytest.approx(cell_errors.FITTED_SHARE * 0.03, rel=0.1)
