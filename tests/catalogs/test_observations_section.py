"""The sentence of the first page on instruments."""

from types import SimpleNamespace

import numpy as np
import xarray as xr

from catalogs.report.sections.observations import brief


def evidence(**instruments: tuple[list[float], float]) -> SimpleNamespace:
    """Instruments by name: what was measured above the model's 0 MPa (NaN without a reading), and the error of it."""
    rows = [(name, one, error) for name, (measured, error) in instruments.items() for one in measured]
    columns = {
        "instrument": np.array([row[0] for row in rows], object),
        "step": np.array(["a"] * len(rows), object),
        "quantity": np.array(["stress"] * len(rows), object),
        "unit": np.array(["MPa"] * len(rows), object),
        "measured": np.array([row[1] for row in rows]),
        "measured_error": np.array([row[2] for row in rows]),
        "modelled": np.zeros(len(rows)),
        "modelled_error": np.zeros(len(rows)),
        "cell": np.ones(len(rows)),
        "failed": np.zeros(len(rows), np.int8),
    }
    return SimpleNamespace(observations=xr.Dataset({name: ("row", values) for name, values in columns.items()}))


def test_the_share_within_errors_is_that_of_all_readings():
    """Each reading counts once, whatever instrument it is of; an instrument that is off is named, the worst one."""
    near, off, worse = ([0.1, -0.2, 0.3, 0.1], 0.5), ([0.0, 3.0], 0.5), ([4.0, -3.0, 4.0, -3.0], 0.5)
    text = "lie within the errors of model and reading"
    assert brief(evidence(near=near)) == f"100 % of 4 readings of 1 instrument {text}."
    found = brief(evidence(near=near, off=off, worse=worse))
    assert found == f"50 % of 10 readings of 3 instruments {text}; farthest off: worse, 3.5 MPa (r.m.s.)."


def test_what_cannot_be_judged_is_said_or_left_out():
    assert brief(SimpleNamespace(observations=None)) == ""
    assert brief(evidence(unread=([np.nan], 0.5))) == ""
    assert brief(evidence(a=([1.0], np.nan))) == "The readings of 1 instrument have no stated error."
    mixed = brief(evidence(a=([1.0], np.nan), b=([0.1], 0.5)))
    assert mixed.startswith("100 % of 1 reading of 1 instrument lie")
