"""Loading measures, plan beside plan."""

from types import SimpleNamespace

import numpy as np
import xarray as xr

from plans.loading_rows import LOADING_VARIABLES, MAX_ROWS, loading_rows

FIRST, SECOND = SimpleNamespace(name="mine_file"), SimpleNamespace(name="later")


def made_up(*rows: tuple) -> xr.Dataset:
    """Loading measures of rows in the order of LOADING_VARIABLES."""
    columns = zip(*rows, strict=True)
    kinds = (object, object, object, float, float, float)
    return xr.Dataset(
        {
            name: ("row", np.array(column, kind))
            for name, column, kind in zip(LOADING_VARIABLES, columns, kinds, strict=True)
        }
    )


def opening(step: str, name: str, rate: float, stiffness: float = np.nan) -> tuple:
    return step, "opening", name, rate, stiffness, np.nan


def plane(step: str, name: str, largest: float) -> tuple:
    return step, "plane", name, np.nan, np.nan, largest


def test_each_opening_stands_with_the_step_that_mines_it():
    """An earlier opening has no rate in later steps; a plan that leaves an opening has a dash."""
    whole = ("a", "step", "all", 9.0, 10.0, np.nan)
    own = made_up(whole, opening("a", "drive", 1.5, 800.0), opening("b", "drive", np.nan), opening("b", "stope", 3.0))
    other = made_up(whole, opening("b", "drive", 2.5, 700.0))
    found = loading_rows([FIRST, SECOND], [own, other])
    assert [row["name"] for row in found["openings"]] == ["stope", "drive"]
    stope, drive = (row["cells"] for row in found["openings"])
    assert [cell["value"] for cell in stope] == ["3.0", "–"]
    assert [(cell["value"], cell["step"], cell["stiffness"]) for cell in drive] == [
        ("1.5", "a", "800"),
        ("2.5", "b", "700"),
    ]
    assert stope[0]["stiffness"] == ""


def test_a_plane_stands_with_its_worst_step():
    own = made_up(plane("a", "dyke", -3.0), plane("b", "dyke", 4.0), plane("c", "dyke", 2.0), plane("a", "low", -9.0))
    other = made_up(plane("a", "dyke", np.nan), plane("a", "low", -8.0))
    found = loading_rows([FIRST, SECOND], [own, other])
    assert [row["name"] for row in found["planes"]] == ["dyke", "low"]
    assert [(cell["value"], cell["step"]) for cell in found["planes"][0]["cells"]] == [("4.0", "b"), ("–", "")]
    assert found["openings"] == []


def test_many_openings_are_those_with_most():
    found = loading_rows([FIRST], [made_up(*(opening("a", f"stope_{one}", float(one)) for one in range(40)))])
    assert [row["name"] for row in found["openings"]] == [f"stope_{one}" for one in range(39, 39 - MAX_ROWS, -1)]
    assert found["left_out"] == f"{MAX_ROWS} of 40 openings are shown. "


def test_without_measures_there_is_no_section():
    assert loading_rows([FIRST], []) == {}
