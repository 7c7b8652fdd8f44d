"""Loading measures in closed form and in relation: slit, sphere, planes; mirrored, turned, split, in another order."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_mines import load

from common.errors import InputError
from common.loading_table import FIELDS
from common.voigt import tensor_from_voigt, voigt_from_tensor
from mpm_core.scene.scene import parse_scene
from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
from mpm_core.stages.grid_stage import make_grid
from response.energy_release import plastic_work_density, strain_energy_density
from response.excess_shear import excess_shear_stress
from response.loading import loading_table
from response.loading_settings import LoadingSlice

YOUNG, POISSON = 50e9, 0.25
SHEAR, BULK = YOUNG / (2 * (1 + POISSON)), YOUNG / (3 * (1 - 2 * POISSON))
ROCK = {"model": "elastic", "youngs_modulus": "50 GPa", "poisson_ratio": POISSON, "density": "2700 kg/m^3"}
EXACT = {"tolerance": 1e-6}
stresses = st.lists(st.floats(-50e6, 50e6), min_size=6, max_size=6).map(np.array)


def measured(folder, excavations, **more):
    """Mine, grid, states (elastic, steps) and the table of loading measures of a small mine."""
    folder.mkdir(exist_ok=True)
    more = {"loading_measures": {}, "solver": EXACT} | more
    steps = more.pop("steps", list(dict.fromkeys(one.get("step", "history") for one in excavations)))
    mine = load(folder, excavations, steps=[{"name": name} for name in steps], **more)
    grid = make_grid(mine.grid_slice(), {})
    states = [elastic_stage(parse_scene(mine.mechanics_slice(0)), grid, folder / "failed.npz")[0]]
    for number in range(len(mine.mined_steps)):
        scene = parse_scene(mine.mechanics_slice(number))
        states.append(mining_step(scene, grid, states[-1], folder / "failed.npz")[0])
    table = loading_table(LoadingSlice.of(mine.loading_slice()), grid, states[0], states[1:])
    return mine, grid, states, table


def row(table, step, name="all"):
    """A row as a dictionary of numbers."""
    found = np.flatnonzero((table["step"].values == step) & (table["name"].values == name))
    assert len(found) == 1
    return {field.name: table[field.name].values[found[0]] for field in FIELDS[3:-1]}


@settings(max_examples=50, deadline=None)
@given(stresses)
def test_strain_energy_is_half_of_stress_times_strain(stress):
    """Against Hooke's law with Young's modulus and Poisson's ratio, component by component."""
    lame = BULK - 2 * SHEAR / 3
    tensor = tensor_from_voigt(stress)
    strain = ((1 + POISSON) * tensor - POISSON * np.trace(tensor) * np.eye(3)) / YOUNG
    found = strain_energy_density(stress[None], np.array([lame]), np.array([SHEAR]))
    np.testing.assert_allclose(found, [0.5 * (tensor * strain).sum()], rtol=1e-9, atol=1e-9)


@settings(max_examples=50, deadline=None)
@given(stresses, st.floats(0.0, 60.0), st.integers(0, 10**6))
def test_no_plane_exceeds_what_mohr_allows(stress, friction, seed):
    """Of planes in all directions the worst is that of Mohr's circle, where all principal stresses are compressions;
    a turned stress on a turned plane is the same."""
    stress = stress - np.array([200e6] * 3 + [0.0] * 3)
    generator = np.random.default_rng(seed)
    normals = generator.normal(size=(3000, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    values = np.linalg.eigvalsh(tensor_from_voigt(stress))
    slope = np.tan(np.radians(friction))
    least, most = -values[2], -values[0]
    worst = 0.5 * (most - least) * np.hypot(1.0, slope) - slope * 0.5 * (most + least)
    found = np.array([excess_shear_stress(stress[None], normal, friction)[0] for normal in normals])
    scale = max(most - least, 1e3) * np.hypot(1.0, slope)
    assert found.max() <= worst + 1e-9 * np.abs(values).max()
    assert found.max() >= worst - 0.05 * scale
    turn, _ = np.linalg.qr(generator.normal(size=(3, 3)))
    turned = voigt_from_tensor(turn @ tensor_from_voigt(stress) @ turn.T)
    np.testing.assert_allclose(excess_shear_stress(turned[None], turn @ normals[0], friction), found[0], atol=1.0)


def test_tension_has_no_friction():
    pulled = np.array([[10e6, 0.0, 0.0, 0.0, 0.0, 4e6]])
    assert excess_shear_stress(pulled, np.array([1.0, 0.0, 0.0]), 45.0)[0] == pytest.approx(4e6)


# A slit of half-width a in plane strain closes by 4 (1 - nu2) p sqrt(a2 - x2) / E and releases pi (1 - nu2) p2 a2 / E.
PRESSURE = 15e6
FLAT = {
    "plane": "xz",
    "thickness": "3 m",
    "domain": {"lower": ["-512 m", "-512 m"], "upper": ["512 m", "512 m"], "boundary": "fixed"},
    "grid": {"coarse_cell": "64 m", "levels": 8, "buffer_cells": 2, "refinement": "static"},
    "insitu_stress": {"constant": {"xx": "-4 MPa", "yy": "-5 MPa", "zz": "-15 MPa"}},
}


def panel(name, start, end, **more):
    """A flat panel, 1 m high."""
    return {"name": name, "shape": "box", "lower": [f"{start} m", "-0.5 m"], "upper": [f"{end} m", "0.5 m"]} | more


def slit_energy(half_width):
    """Energy that a slit releases, J per metre."""
    return np.pi * (1 - POISSON**2) * PRESSURE**2 * half_width**2 / YOUNG


def test_a_slit_releases_its_energy_at_its_stiffness(tmp_path):
    """A panel sixty times as wide as high in half of a metre's cells; 3 % for its height and the boundary."""
    _, _, _, table = measured(tmp_path, [panel("panel", -30, 30, fill="none")], **FLAT)
    found = row(table, "history")
    assert found["mined_volume"] == pytest.approx(3.0 * 60.0 * 1.0, rel=1e-6)
    assert found["mined_area"] == pytest.approx(3.0 * 60.0, rel=1e-3)
    through_walls = found["energy_released"] - found["energy_mined"]
    assert through_walls == pytest.approx(3.0 * slit_energy(30.0) / 1e6, rel=0.03)
    stiffness = 2.0 * YOUNG / (np.pi * (1 - POISSON**2) * 30.0)
    assert found["loading_stiffness"] == pytest.approx(stiffness / 1e6, rel=0.03)
    virgin = strain_energy_density(np.array([[-4e6, -5e6, -15e6, 0, 0, 0]]), *np.array([[SHEAR], [SHEAR]]))
    assert found["energy_mined"] == pytest.approx(virgin[0] * 180.0 / 1e6, rel=1e-6)
    assert row(table, "history", "panel") == pytest.approx(found, nan_ok=True)


def test_a_widening_slit_releases_the_difference(tmp_path):
    """Both sides in one step: each half of it; the sum of steps is what mining at once releases."""
    sides = [panel("west", -30, -24, step="wider", fill="none"), panel("east", 24, 30, step="wider", fill="none")]
    middle = panel("middle", -24, 24, fill="none")
    _, _, _, table = measured(tmp_path / "parts", [middle, *sides], **FLAT)
    _, _, _, at_once = measured(tmp_path / "once", [panel("panel", -30, 30, fill="none")], **FLAT)
    first, later = row(table, "history"), row(table, "wider")
    expected = 3.0 * (slit_energy(30.0) - slit_energy(24.0)) / 1e6
    assert later["energy_released"] == pytest.approx(expected, rel=0.06)
    assert later["release_rate"] == pytest.approx(expected / (2 * 6 * 3), rel=0.06)
    for side in ("west", "east"):
        assert row(table, "wider", side)["energy_released"] == pytest.approx(0.5 * later["energy_released"], rel=0.005)
    whole = row(at_once, "history")
    assert first["energy_released"] + later["energy_released"] == pytest.approx(whole["energy_released"], rel=0.003)
    # what rock takes along grows, what is set in motion falls
    assert first["energy_mined"] + later["energy_mined"] > 1.5 * whole["energy_mined"]


# A sphere in all-round compression p: its wall moves by p a / (4 G), whatever was mined within it before.
POINT = {"name": "dyke", "point": ["9 m", "0 m", "0 m"], "strike": "0 deg", "dip": "60 deg"}
SPHERE = {
    "half": 32.0,
    "grid": {"coarse_cell": "4 m", "levels": 3, "buffer_cells": 2},
    "insitu_stress": {"constant": {"xx": "-20 MPa", "yy": "-20 MPa", "zz": "-20 MPa"}},
    "materials": {"host": ROCK, "soft": ROCK | {"youngs_modulus": "5 GPa"}},
}


def ball(name, radius, **more):
    """A sphere around the middle."""
    return {"name": name, "shape": "sphere", "center": ["0 m"] * 3, "radius": f"{radius} m"} | more


@pytest.fixture(scope="module")
def sphere(tmp_path_factory):
    """Table of a sphere of 6 m that is mined at once."""
    return measured(tmp_path_factory.mktemp("sphere"), [ball("sphere", 6, fill="none")], **SPHERE)[3]


def test_a_sphere_releases_goodiers_energy(sphere):
    """Energy in the rock, p2 V / 2K, and through the wall, 3 p2 V / 8G; 3 % in six cells to the radius."""
    found, volume, pressure = row(sphere, "history"), 4 / 3 * np.pi * 6.0**3, 20e6
    mined = pressure**2 * volume / (2 * BULK) / 1e6
    assert found["energy_mined"] == pytest.approx(mined, rel=0.01)
    through_wall = 3.0 * pressure**2 * volume / (8 * SHEAR) / 1e6
    assert found["energy_released"] - mined == pytest.approx(through_wall, rel=0.03)
    assert found["loading_stiffness"] == pytest.approx(4 * SHEAR / 6.0 / 1e6, rel=0.03)
    assert found["unloaded_stress"] == pytest.approx(20.0, rel=1e-6)
    assert found["mined_area"] == pytest.approx(volume / 12.0, rel=0.02)
    assert found["plastic_work"] == 0.0


def test_steps_of_a_sphere_add_up(tmp_path, sphere):
    """A sphere that is widened has released as much, in the end, and its wall the same stiffness."""
    parts = [ball("sphere", 4, fill="none"), ball("rest", 6, step="wider", fill="none")]
    table = measured(tmp_path, parts, **SPHERE)[3]
    first, later, once = row(table, "history"), row(table, "wider"), row(sphere, "history")
    assert first["energy_released"] + later["energy_released"] == pytest.approx(once["energy_released"], rel=0.01)
    assert first["mined_volume"] + later["mined_volume"] == pytest.approx(once["mined_volume"], rel=1e-9)
    assert later["loading_stiffness"] == pytest.approx(4 * SHEAR / 6.0 / 1e6, rel=0.06)


def test_twice_the_stress_is_four_times_the_energy(tmp_path, sphere):
    double = {"insitu_stress": {"constant": dict.fromkeys(("xx", "yy", "zz"), "-40 MPa")}}
    found, once = (
        row(measured(tmp_path, [ball("sphere", 6, fill="none")], **SPHERE | double)[3], "history"),
        row(sphere, "history"),
    )
    for key in ("energy_mined", "energy_released", "release_rate"):
        assert found[key] == pytest.approx(4.0 * once[key], rel=1e-4)
    assert found["loading_stiffness"] == pytest.approx(once["loading_stiffness"], rel=1e-4)


@pytest.mark.parametrize("holds", [{"fill": "soft"}, {"fill": "none", "pressure": "5 MPa"}], ids=["fill", "pressure"])
def test_what_holds_a_wall_leaves_the_stiffness(tmp_path, sphere, holds):
    """The rock around a filled sphere is as stiff as around an empty one: less is taken off the wall, and it moves
    less."""
    found, once = (
        row(measured(tmp_path, [ball("sphere", 6, **holds)], **SPHERE)[3], "history"),
        row(sphere, "history"),
    )
    assert found["unloaded_stress"] < 0.97 * once["unloaded_stress"]
    assert found["loading_stiffness"] == pytest.approx(4 * SHEAR / 6.0 / 1e6, rel=0.04)


ROOMS = (
    {"name": "first", "lower": [-9, -5, -3], "upper": [-2, 4, 3]},
    {"name": "second", "lower": [2, -3, -2], "upper": [8, 6, 5], "step": "next"},
    {"name": "third", "lower": [-1, 7, -4], "upper": [7, 10, 2], "step": "next"},
)
STRESS = np.array([-10.0, -25.0, -15.0, 2.0, -1.0, 3.0])
PLANE = {"name": "plane", "point": [10.37, 1.81, 0.93], "strike": 20.0, "dip": 60.0}


def rooms(folder, turn=None, order=(0, 1, 2), strike=0.0, reversed_dip=False):
    """Table of three rooms, two of which are mined together, turned or mirrored by a matrix of -1, 0 and 1."""
    turn = np.eye(3) if turn is None else turn
    tensor = turn @ tensor_from_voigt(STRESS) @ turn.T
    excavations = []
    for one in (ROOMS[number] for number in order):
        corners = np.sort(np.array([one["lower"], one["upper"]]) @ turn.T, axis=0)
        placed = {
            key: [f"{value:g} m" for value in corner] for key, corner in zip(("lower", "upper"), corners, strict=True)
        }
        excavations.append({**one, **placed, "shape": "box", "fill": "none"})
    names = ("xx", "yy", "zz", "yz", "xz", "xy")
    plane = PLANE | {
        "point": [f"{value:g} m" for value in turn @ PLANE["point"]],
        "strike": f"{(-1 if reversed_dip else 1) * PLANE['strike'] + strike:g} deg",
        "dip": "60 deg",
        "radius": "4 m",
    }
    stress = {name: f"{value:g} MPa" for name, value in zip(names, voigt_from_tensor(tensor), strict=True)}
    more = {"insitu_stress": {"constant": stress}, "loading_measures": {"planes": [plane]}}
    return measured(folder, excavations, steps=["history", "next"], **more)[3]


@pytest.fixture(scope="module")
def asymmetric(tmp_path_factory):
    return rooms(tmp_path_factory.mktemp("rooms"))


QUARTER = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # clockwise in plan
MIRROR = np.diag([-1.0, 1.0, 1.0])


@pytest.mark.parametrize(
    "how",
    [{"turn": QUARTER, "strike": 90.0}, {"turn": MIRROR, "strike": 180.0, "reversed_dip": True}, {"order": (2, 1, 0)}],
    ids=["turned", "mirrored", "reordered"],
)
def test_measures_do_not_depend_on_axes_or_order(tmp_path, asymmetric, how):
    found = rooms(tmp_path, **how)
    for step, names in {"history": ("all", "first", "plane"), "next": ("all", "second", "third", "plane")}.items():
        for name in names:
            one, other = row(asymmetric, step, name), row(found, step, name)
            place = [other.pop(axis) for axis in "xyz"], [one.pop(axis) for axis in "xyz"]
            assert other == pytest.approx(one, rel=0.01, nan_ok=True)
            if name == "plane":
                np.testing.assert_allclose(place[0], how.get("turn", np.eye(3)) @ place[1], atol=0.01)


def test_energy_of_a_step_is_that_of_its_openings(asymmetric):
    """Both rooms of a step have a part, the room of the step before none."""
    parts = [row(asymmetric, "next", name) for name in ("first", "second", "third")]
    whole = row(asymmetric, "next")
    assert parts[0]["energy_released"] == 0.0
    assert np.isnan(parts[0]["release_rate"])
    for key in ("mined_volume", "mined_area", "energy_mined", "energy_released"):
        assert sum(part[key] for part in parts) == pytest.approx(whole[key], rel=1e-9)
    assert min(part["energy_released"] for part in parts[1:]) > 0.1 * whole["energy_released"]


def test_openings_that_are_far_apart_share_a_step_as_if_each_were_alone(tmp_path):
    """Two spheres of one step, of which one has about five times the energy: each has what its own run releases."""
    small = ball("small", 3, fill="none") | {"center": ["-16 m", "-16 m", "-16 m"]}
    large = ball("large", 5, fill="none") | {"center": ["14 m", "14 m", "14 m"]}
    both = measured(tmp_path / "both", [small, large], **SPHERE)[3]
    for one, name in ((small, "small"), (large, "large")):
        alone = row(measured(tmp_path / name, [one], **SPHERE)[3], "history")
        found = row(both, "history", name)
        for key in ("energy_mined", "energy_released", "loading_stiffness"):
            assert found[key] == pytest.approx(alone[key], rel=0.03), key


def test_overlapping_excavations_mine_their_rock_once(tmp_path):
    """Of one step half each, of two the first all: as much as the union."""
    west = {"name": "west", "shape": "box", "lower": ["-6 m", "-3 m", "-3 m"], "upper": ["2 m", "3 m", "3 m"]}
    east = west | {"name": "east", "lower": ["-2 m", "-3 m", "-3 m"], "upper": ["6 m", "3 m", "3 m"]}
    together = measured(tmp_path / "together", [west | {"fill": "none"}, east | {"fill": "none"}])[3]
    volumes = [row(together, "history", name)["mined_volume"] for name in ("west", "east", "all")]
    np.testing.assert_allclose(volumes, [216.0, 216.0, 432.0])
    later = measured(tmp_path / "later", [west | {"fill": "none"}, east | {"fill": "none", "step": "next"}])[3]
    assert row(later, "history", "west")["mined_volume"] == pytest.approx(288.0)
    assert row(later, "next", "east")["mined_volume"] == pytest.approx(144.0)


BRITTLE = {
    "host": ROCK
    | {
        "model": "coulomb",
        "friction_angle": {"intact": "30 deg", "residual": "25 deg"},
        "dilation_angle": {"intact": "5 deg", "residual": "5 deg"},
        "cohesion": {"intact": "8 MPa", "residual": "2 MPa"},
        "tension_cutoff": {"intact": "1 MPa", "residual": "0 MPa"},
    }
}
STRONG = {"constant": {"xx": "-20 MPa", "yy": "-45 MPa", "zz": "-20 MPa"}}


def test_plastic_work_is_that_of_the_balance(tmp_path):
    """All that a step dissipates, near the openings where rock fails; its density is that of the balance but for stress
    that falls after the drop."""
    boxes = [{**one, "shape": "box", "fill": "none"} for one in ROOMS[:2]]
    boxes = [one | {key: [f"{value} m" for value in one[key]] for key in ("lower", "upper")} for one in boxes]
    _, _, states, table = measured(tmp_path, boxes, materials=BRITTLE, insitu_stress=STRONG, solver={})
    for step, state in zip(("history", "next"), states[1:], strict=True):
        dissipated = state.attrs["energy_dissipated"] / 1e6
        assert dissipated > 0.0
        found = row(table, step)
        assert found["plastic_work"] == pytest.approx(dissipated, rel=1e-9)
        terms = {name: state.attrs[f"energy_{name}"] / 1e6 for name in ("released", "mined", "support")}
        through_walls = found["energy_released"] - found["energy_mined"]
        if step == "next":  # the first step has the elastic history, too
            assert terms["support"] > 0.0
            assert through_walls == pytest.approx(terms["released"] - terms["mined"] + terms["support"])
        own = float(plastic_work_density(state) @ state["volume"].values) / 1e6
        assert 0.6 * dissipated < own < 1.05 * dissipated
        failed = float(state["volume"].values[state["failed"].values >= 0].sum())
        assert 0.0 < found["plastic_volume"] <= failed
    assert row(table, "next", "second")["plastic_work"] > row(table, "next", "first")["plastic_work"] > 0.0
    assert row(table, "next")["energy_released"] > row(table, "next")["plastic_work"]


def test_the_plastic_volume_of_a_step_is_that_of_all_its_rock(tmp_path):
    """Nine tenths of the work of two openings lie in less rock than nine tenths of each; a step after a collapse has
    no row, and no opening of its own either."""
    boxes = [{**one, "shape": "box", "fill": "none"} for one in ROOMS[:2]]
    boxes = [one | {key: [f"{value} m" for value in one[key]] for key in ("lower", "upper")} for one in boxes]
    mine, grid, states, table = measured(tmp_path, boxes, materials=BRITTLE, insitu_stress=STRONG, solver={})
    state = states[2]
    density, volume = plastic_work_density(state), state["volume"].values
    order = np.argsort(-density, kind="stable")
    done = np.cumsum((density * volume)[order])
    enough = int(np.searchsorted(done, 0.9 * done[-1]))
    assert row(table, "next")["plastic_volume"] == pytest.approx(volume[order][: enough + 1].sum())
    parts = [row(table, "next", name)["plastic_volume"] for name in ("first", "second")]
    assert row(table, "next")["plastic_volume"] != pytest.approx(sum(parts))
    lost = [states[1], states[1].assign_attrs(computed=0)]
    short = loading_table(LoadingSlice.of(mine.loading_slice()), grid, states[0], lost)
    assert set(short["step"].values.tolist()) == {"history"}


def test_steps_that_mine_nothing_release_nothing(tmp_path):
    """A step that does nothing, and one that fills the sphere, which stays as it is: later fill bears nothing yet."""
    ball_then_fill = ball("sphere", 4, fill="soft", filled="fills")
    table = measured(tmp_path, [ball_then_fill], steps=["history", "idle", "fills"], **SPHERE)[3]
    whole = row(table, "history")["energy_released"]
    for step in ("idle", "fills"):
        for name in ("all", "sphere"):
            found = row(table, step, name)
            assert found["mined_volume"] == 0.0
            assert abs(found["energy_released"]) < 1e-4 * whole
            assert np.isnan(found["release_rate"])
            assert np.isnan(found["loading_stiffness"])


def test_a_mine_without_openings_has_rows_of_its_steps(tmp_path):
    """None is mined yet: the planned one has no row, and a plane has its stress and no opening near it."""
    planned = ball("sphere", 4, step="planned")
    more = SPHERE | {"loading_measures": {"planes": [POINT]}}
    table = measured(tmp_path, [planned], steps=["history"], **more)[3]
    assert table["name"].values.tolist() == ["all", "dyke"]
    assert row(table, "history")["energy_released"] == pytest.approx(0.0, abs=1e-6)
    assert row(table, "history", "dyke")["ess_at_point"] == pytest.approx(-np.tan(np.radians(30.0)) * 20.0, rel=1e-3)
    assert table["nearest_opening"].values.tolist() == ["", ""]


def test_asked_for_measures_alone_have_values(tmp_path):
    table = measured(tmp_path, [ball("sphere", 6, fill="none")], loading_measures={"measures": ["plastic_work"]})[3]
    found = row(table, "history")
    assert np.isnan(found["energy_released"])
    assert np.isnan(found["loading_stiffness"])
    assert found["plastic_work"] == 0.0
    assert set(table) == {field.name for field in FIELDS}


def test_planes_far_from_openings_have_the_virgin_stress(tmp_path):
    """A point and a disc in the corner; a plane within the opening has no rock."""
    planes = [
        {"name": "far", "point": ["-28 m", "-27 m", "26 m"], "strike": "35 deg", "dip": "50 deg", "radius": "2 m"},
        {"name": "within", "point": ["0 m", "0 m", "0 m"], "strike": "35 deg", "dip": "50 deg", "radius": "2 m"},
    ]
    stress = {"constant": {"xx": "-10 MPa", "yy": "-40 MPa", "zz": "-20 MPa"}}
    more = {"loading_measures": {"planes": planes, "dynamic_friction": "10 deg"}, "insitu_stress": stress}
    table = measured(tmp_path, [ball("sphere", 4, fill="none")], **SPHERE | more)[3]
    dip, strike = np.radians(50.0), np.radians(35.0)
    normal = np.array([np.sin(dip) * np.cos(strike), -np.sin(dip) * np.sin(strike), np.cos(dip)])
    expected = excess_shear_stress(np.array([[-10e6, -40e6, -20e6, 0, 0, 0]]), normal, 10.0)[0] / 1e6
    far = row(table, "history", "far")
    assert far["ess_at_point"] == pytest.approx(expected, abs=0.3)
    assert expected > 2.0
    assert far["ess_area"] == pytest.approx(np.pi * 2.0**2, rel=1e-6)
    assert np.isnan(row(table, "history", "within")["ess_largest"])
    nearest = table["nearest_opening"].values[table["name"].values == "far"]
    assert nearest.tolist() == ["sphere"]


def test_weak_planes_of_a_rock_have_a_volume(tmp_path):
    weak = BRITTLE["host"] | {
        "model": "weak_planes",
        "planes": {
            "dip": "60 deg", "dip_direction": "90 deg",
            **{key: BRITTLE["host"][key] for key in ("friction_angle", "dilation_angle", "cohesion", "tension_cutoff")},
        },
    }  # fmt: skip
    seam = {"name": "seam", "material": "weak", "shape": "box", "refine": True}
    seam |= {"lower": ["8 m", "-4 m", "-4 m"], "upper": ["10 m", "4 m", "4 m"]}
    more = {
        "materials": {"host": ROCK, "weak": weak},
        "rock_bodies": [seam],
        "insitu_stress": {"constant": {"xx": "-2 MPa", "yy": "-8 MPa", "zz": "-12 MPa"}},
        "loading_measures": {"planes": [{"name": "seam", "material": "weak"}], "dynamic_friction": "10 deg"},
    }
    found = row(measured(tmp_path, [ball("sphere", 4, fill="none")], **more)[3], "history", "seam")
    assert 0.0 < found["ess_volume"] <= 2 * 8 * 8 * (1 + 1e-9)
    assert found["ess_largest"] >= found["ess_mean"] > 0.0
    assert np.isnan(found["ess_area"])
    assert 8.0 <= found["x"] <= 10.0


@pytest.mark.parametrize(
    ("measures", "message"),
    [
        ({"measures": ["energy"]}, "energy_release_rate"),
        ({"measures": []}, "loading_measures.measures"),
        ({"measures": ["plastic_work"], "planes": [POINT]}, "stand without excess_shear_stress"),
        ({"measures": ["excess_shear_stress"]}, "needs planes"),
        ({"planes": [POINT, POINT]}, "stands twice"),
        ({"planes": [POINT | {"material": "host"}]}, "stands beside material"),
        ({"planes": [{"name": "dyke", "strike": "0 deg", "dip": "60 deg"}]}, "planes\\[0\\].point: missing"),
        ({"planes": [POINT | {"point": ["90 m", "0 m", "0 m"]}]}, "outside the domain"),
        ({"planes": [POINT | {"point": ["0 m", "0 m", "1 m"]}]}, "inside sphere"),
        ({"planes": [POINT | {"dip": "60 m"}]}, "dip"),
        ({"planes": [{"name": "fault", "material": "hots"}]}, "did you mean host"),
        ({"planes": [{"name": "fault", "material": "host"}]}, "has no planes"),
        ({"dynamic_friction": "95 deg"}, "out of range"),
        ({"dynamic_friction": 30}, "has no unit"),
    ],
)
def test_mistakes_are_one_line_each(tmp_path, measures, message):
    with pytest.raises(InputError, match=message) as raised:
        load(tmp_path, [ball("sphere", 4)], loading_measures=measures)
    assert "\n" not in str(raised.value).strip()
    assert "loading_measures" in str(raised.value)


def test_a_mine_without_steps_and_a_plane_in_a_section_are_refused(tmp_path):
    with pytest.raises(InputError, match="loading_measures: no step is listed"):
        load(tmp_path, [ball("sphere", 4)], steps=[], loading_measures={})
    with pytest.raises(InputError, match=r"loading_measures.planes\[0\]: .* three dimensions"):
        load(tmp_path, [panel("panel", -30, 30)], **FLAT, loading_measures={"planes": [POINT]})


def test_a_mine_in_its_own_grid_has_its_planes_on_the_map(tmp_path):
    """Points are moved and turned; strikes count from the map's north already."""
    grid = {"units": "m", "angle": "90 deg", "origin": {"grid": ["0 m", "0 m"], "map": ["100 m", "200 m"]}}
    mine = load(
        tmp_path, [ball("sphere", 4)], frame={"surface": "0 m", "grid": grid}, loading_measures={"planes": [POINT]}
    )
    found = mine.loading_slice()["loading_measures"]["planes"][0]
    np.testing.assert_allclose(np.abs(np.array(found["point"]) - [100.0, 200.0, 0.0]), [0.0, 9.0, 0.0], atol=1e-9)
    assert found["strike"] == 0.0
    assert json.dumps(mine.loading_slice())
