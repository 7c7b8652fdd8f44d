"""Velocities at openings, plan beside plan."""

from types import SimpleNamespace

import numpy as np
import xarray as xr

from plans.shaking_rows import MAX_ROWS, shaking_rows


def made_up(openings: list[str], velocity: np.ndarray, filled: np.ndarray, demand: float = np.nan) -> xr.Dataset:
    """Shaking with these velocities (step, opening) at three chances, of which the middle one counts."""
    shape = (*velocity.shape, 3)
    at = velocity[..., None] * np.array([0.5, 1.0, 2.0])
    return xr.Dataset(
        {
            "velocity": (("step", "opening", "chance"), at),
            "velocity_interval": (("step", "opening", "chance", "interval"), np.stack([0.8 * at, 1.5 * at], axis=-1)),
            "demand": (("step", "opening", "chance", "side"), np.full((*shape, 4), demand)),
            "filled": (("step", "opening"), filled),
            "step": np.array(["2019-08", "2019-09"], object),
            "opening": np.array(openings, object),
            "chance": [0.5, 0.1, 0.02],
        },
        attrs={"relation_text": "log10 v = -5.25 + 0.49 s - 1 log10(R)", "depth_source": "the mine file"},
    )


FIRST, SECOND = SimpleNamespace(name="mine_file"), SimpleNamespace(name="later")


def test_each_opening_stands_with_its_largest_velocity_and_that_step():
    own = made_up(["drive", "stope"], np.array([[0.2, np.nan], [0.1, 0.4]]), np.array([[0, -1], [0, 0]]), 5600.0)
    other = made_up(["drive"], np.array([[0.05], [0.3]]), np.array([[0], [0]]))
    found = shaking_rows([FIRST, SECOND], [own, other])
    assert found["chance"] == "10 %"
    assert found["has_demand"]
    assert found["depth_source"] == "the mine file"
    assert [row["opening"] for row in found["rows"]] == ["stope", "drive"]
    stope, drive = (row["cells"] for row in found["rows"])
    assert (stope[0]["velocity"], stope[0]["step"], stope[0]["demand"]) == ("0.40", "2019-09", "5.6")
    assert stope[1]["velocity"] == "–"
    assert [(one["velocity"], one["step"]) for one in drive] == [("0.20", "2019-08"), ("0.30", "2019-09")]
    assert drive[0]["interval"] == "0.16 to 0.30"
    assert drive[1]["demand"] == ""


def test_many_openings_are_those_with_most():
    names = [f"stope_{number}" for number in range(40)]
    velocity = np.tile(np.arange(40.0), (2, 1)) / 100.0
    found = shaking_rows([FIRST], [made_up(names, velocity, np.zeros((2, 40), int))])
    assert len(found["rows"]) == MAX_ROWS
    assert found["rows"][0]["opening"] == "stope_39"
    assert found["left_out"].startswith(f"{MAX_ROWS} of 40 openings")


def test_without_shaking_there_is_no_section():
    assert shaking_rows([FIRST], []) == {}
