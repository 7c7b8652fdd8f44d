"""Virgin stress against strength: each rock by its own, where it lies, before anything runs."""

import numpy as np
import pytest
from tiny_mines import FLAT, HOST, TINY, changed

from common.errors import InputError
from common.voigt import tensor_from_voigt
from workflow.virgin_rock import Rocks, check_virgin_stress

# The host of the tiny mine would fail under this stress from D = 949 m on, z = 51 m: N xx - zz exceeds 3.46 MPa.
STEEP = {"constant": {}, "gradient": {"xx": "-0.0093 MPa/m", "yy": "-0.0093 MPa/m", "zz": "-0.03155 MPa/m"}}
STRONG = HOST | {"cohesion": {"intact": "10 MPa", "residual": "10 MPa"}}


def body(lower, upper, **others) -> dict:
    corners = {key: [f"{value} m" for value in corner] for key, corner in (("lower", lower), ("upper", upper))}
    return {"name": "floor", "material": "strong", "shape": "box", **corners, **others}


def steep(mine: dict = TINY, **values) -> dict:
    materials = mine["materials"] | {"strong": STRONG}
    return changed(
        {key: mine[key] for key in mine if key != "record"}, insitu_stress=STEEP, materials=materials, **values
    )


FLOOR = body([-10, -10, -10], [90, 90, 65])
FLAT_FLOOR = {key: [value[0], value[2]] if key in ("lower", "upper") else value for key, value in FLOOR.items()}


@pytest.mark.parametrize(("mine", "floor"), [(TINY, FLOOR), (FLAT, FLAT_FLOOR)], ids=["space", "section"])
def test_the_host_is_checked_where_there_is_host(accept, refuse, mine, floor):
    line = refuse(steep(mine))
    assert line.startswith("insitu_stress: at elevation 0 m (domain.lower) virgin stress is")
    assert "above the intact strength of materials.host: it would fail before" in line
    accept(steep(mine, rock_bodies=[floor]))
    half = changed(floor, **{"upper.0": "40 m"})
    assert "materials.host" in refuse(steep(mine, rock_bodies=[half]))
    assert "materials.host" in refuse(steep(mine, rock_bodies=[floor, floor | {"name": "patch", "material": "host"}]))


def test_a_body_may_end_where_the_domain_does(accept):
    accept(steep(rock_bodies=[body([0, 0, 0], [80, 80, 60])]))
    thin = accept(changed(TINY, rock_bodies=[body([0, 0, 0], [80, 80, 1])], **{"materials.strong": STRONG}))
    points = np.array([[40.0, 40.0, 0.5], [40.0, 40.0, 1.5]])
    assert Rocks.of(thin).at(points).tolist() == ["strong", "host"]


def test_another_rock_is_checked_by_its_own_strength(refuse):
    weak = changed(
        steep(rock_bodies=[FLOOR]), **{"materials.strong.cohesion": {"intact": "0.1 MPa", "residual": "0 Pa"}}
    )
    assert "above the intact strength of materials.strong" in refuse(weak)
    lens = body([30, 30, 10], [50, 50, 30]) | {"name": "lens"}
    weak = changed(weak, rock_bodies=[FLOOR | {"material": "sound"}, lens])
    weak["materials"]["sound"] = STRONG
    line = refuse(weak)
    assert "materials.strong" in line
    assert "domain" not in line


def test_rock_outside_a_body_is_of_it_where_it_says_so(accept, refuse):
    outside = body([-10, -10, 65], [90, 90, 90], outside=True)
    accept(steep(rock_bodies=[outside]))
    assert "materials.host" in refuse(steep(rock_bodies=[outside | {"outside": False}]))


def test_a_body_from_a_file_is_left_to_the_elastic_history(accept, tmp_path, monkeypatch):
    """Reading it would make each start slow."""
    mine = accept(steep(rock_bodies=[FLOOR]))
    from_file = mine.settings.rock_bodies[0].model_copy(update={"file": "floor.stl", "shape": None})
    mine.settings = mine.settings.model_copy(update={"rock_bodies": (from_file,)})
    check_virgin_stress(mine)
    mine.settings = mine.settings.model_copy(update={"rock_bodies": ()})
    with pytest.raises(InputError, match=r"materials\.host"):
        check_virgin_stress(mine)


def test_a_derived_domain_goes_as_deep_as_its_rock_bears(accept, refuse):
    """Strong rock below lets the domain of a host that is weak there reach further down; weak rock below ends it."""
    mine = {key: value for key, value in steep().items() if key not in ("domain", "grid")}
    mine = changed(
        mine, grid={"finest_cell": "5 m"}, **{"materials.host.cohesion": {"intact": "1.1 MPa", "residual": "1 MPa"}}
    )
    lower, upper = [-9000, -9000, -9000], [9000, 9000, -40]
    alone, above_strong = accept(mine), accept(mine | {"rock_bodies": [body(lower, upper)]})
    assert (alone.far_field.limited, above_strong.far_field.limited) == ("strength", "")
    assert above_strong.settings.domain.lower[2] < alone.settings.domain.lower[2]
    sound = changed(
        mine, **{"materials.host.cohesion": STRONG["cohesion"], "materials.strong.cohesion": HOST["cohesion"]}
    )
    above_weak = accept(sound | {"rock_bodies": [body(lower, upper)]})
    assert accept(sound).far_field.limited == ""
    assert above_weak.far_field.limited == "strength"
    assert above_weak.settings.domain.lower[2] >= -40.0
    line = refuse(sound | {"rock_bodies": [body(lower, [9000, 9000, 20])]})
    assert line.startswith(
        "insitu_stress: virgin stress reaches the intact strength of materials.strong at elevation 20 m"
    )


def test_principal_stresses_are_those_of_the_components(accept, refuse):
    """The tiny mine's stress, turned into principal stresses at the surface and at 1 m; and a sign that is wrong."""
    written = accept(TINY).mechanics_slice(0)["insitu_stress"]
    values, axes = np.linalg.eigh(tensor_from_voigt(written["gradient"]))
    section = {
        f"sigma_{number}": {
            "gradient": f"{float(value)!r} Pa/m",
            "trend": f"{float(np.degrees(np.arctan2(axis[0], axis[1])))!r} deg",
            "plunge": f"{float(np.degrees(-np.arcsin(axis[2])))!r} deg",
        }
        for number, (value, axis) in enumerate(zip(values, axes.T, strict=True), 1)
    }
    found = accept(TINY, insitu_stress={"principal": section}).mechanics_slice(0)["insitu_stress"]
    np.testing.assert_allclose(found["gradient"], written["gradient"], atol=1e-9 * abs(values).max())
    assert found["constant"] == [0.0] * 6
    turned = {name: one | {"gradient": one["gradient"].lstrip("-")} for name, one in section.items()}
    line = refuse(TINY, insitu_stress={"principal": turned})
    assert line.startswith("insitu_stress.principal: its gradient of zz is positive")
    line = refuse(TINY, insitu_stress={"principal": section | {"sigma_1": section["sigma_1"] | {"trend": "20 deg"}}})
    assert "principal axes are at right angles, within 3 degrees" in line
