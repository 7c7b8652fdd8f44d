"""Rock from a block model in a mine's file: what is refused, what follows from its values, and the grid's rock."""

import json
import logging
import re

import numpy as np
import pytest
from tiny_mines import FLAT, HOST, TINY, changed

from common.errors import InputError
from mpm_core.block_settings import PlacedBlocks, class_text
from mpm_core.files.state_datasets import read_grid
from mpm_core.scene.rock_blocks import read_blocks
from mpm_core.stages.grid_stage import make_grid

DYKE = HOST | {"youngs_modulus": "30 GPa"}
CLASSES = {"column": "ROCK", "materials": {"W": "host", "D": "dyke"}}
MODEL = {"file": "blocks.csv", "classes": CLASSES}
HEADER = "XC,YC,ZC,XINC,YINC,ZINC,ROCK,E"


def rows(rock=lambda x, y, z: "D" if x < 40 else "W", side=10, reach=80, young=lambda x, y, z: 20 + z / 4):
    """A table of cubes of this side in the tiny mine's domain."""
    middle = np.arange(side / 2, reach, side)
    return [
        f"{x:g},{y:g},{z:g},{side},{side},{side},{rock(x, y, z)},{young(x, y, z)}"
        for x in middle for y in middle for z in middle
    ]  # fmt: skip


@pytest.fixture
def model(tmp_path):
    """The tiny mine with a block model; writes the table."""

    def made(table=None, header=HEADER, **values) -> dict:
        (tmp_path / "blocks.csv").write_text("\n".join([header, *(rows() if table is None else table)]) + "\n")
        return changed(TINY, **{"materials.dyke": DYKE, "block_model": MODEL | values})

    return made


def grid(mine):
    return make_grid(mine.grid_slice(), {})


def centers(made) -> np.ndarray:
    """Middles of the cells (cell, 3) m."""
    return read_grid(made)[0].cell_center


def test_classes_are_the_rock_bodies_of_the_same_place(accept, model):
    """A half of the domain, by blocks and by a box."""
    half = {"name": "half", "shape": "box", "lower": ["0 m", "0 m", "0 m"], "upper": ["40 m", "80 m", "80 m"]}
    solid = grid(accept(changed(TINY, **{"materials.dyke": DYKE, "rock_bodies": [half | {"material": "dyke"}]})))
    mine = accept(model())
    made = grid(mine)
    names = np.array([*mine.body_materials(), "host"])
    assert np.array_equal(names[made.cell_body.values] == "dyke", solid.cell_body.values == 0)
    assert mine.mechanics_slice(0)["rock_bodies"] == [{"material": "host"}, {"material": "dyke"}]
    assert json.loads(made.attrs["block_model"])["shares"] == pytest.approx({"host": 0.5, "dyke": 0.5})


def test_rock_bodies_replace_blocks(accept, model):
    lens = {"name": "lens", "material": "host", "shape": "box", "lower": ["0 m"] * 3, "upper": ["80 m", "80 m", "40 m"]}
    mine = accept(model() | {"rock_bodies": [lens]})
    made = grid(mine)
    low = centers(made)[:, 2] < 40.0
    assert (made.cell_body.values[low] == 0).all()
    assert set(np.array(mine.body_materials())[made.cell_body.values[~low]]) == {"host", "dyke"}


def test_rock_outside_of_all_blocks_is_host(accept, model):
    made = grid(accept(model(table=rows(reach=40))))
    inside = (centers(made) < 40.0).all(axis=1)
    assert np.array_equal(made.cell_body.values >= 0, inside)


def test_a_block_takes_the_nearest_of_the_values_and_strength_keeps_its_share(accept, model):
    properties = {
        "youngs_modulus": {"column": "E", "unit": "GPa", "values": [20, 30, 40]},
        "cohesion": {"column": "E", "unit": "MPa", "values": [20, 40]},
    }
    mine = accept(model(properties=properties))
    made, names = grid(mine), mine.body_materials()
    materials = mine.mechanics_slice(0)["materials"]
    assert len(names) == 2 * 4 * 3
    own = HOST["cohesion"]
    share = float(own["residual"].split()[0]) / float(own["intact"].split()[0])
    for z, young, cohesion in ((4.0, 20e9, 20e6), (25.0, 30e9, 20e6), (76.0, 40e9, 40e6)):
        cell = np.flatnonzero(np.abs(centers(made)[:, 2] - z) < 4.0)
        rock = {names[body] for body in made.cell_body.values[cell]}
        assert len(rock) == 2  # of the dyke and of the host
        for name in rock:
            assert materials[name]["youngs_modulus"] == young
            assert materials[name]["cohesion"]["intact"] == cohesion
            assert materials[name]["cohesion"]["residual"] == pytest.approx(share * cohesion)


def test_blocks_without_a_number_keep_the_own_value(accept, model, caplog):
    table = rows(young=lambda x, y, z: -99 if z < 40 else 30)
    young = {"youngs_modulus": {"column": "E", "unit": "GPa", "values": [30]}}
    mine = accept(model(table=table, properties=young))
    with caplog.at_level(logging.WARNING):
        made = grid(mine)
    assert "256 of 512 blocks have no number above 0" in caplog.text
    names = np.array(mine.body_materials())[made.cell_body.values]
    low = centers(made)[:, 2] < 40.0
    assert set(names[low]) == {"host", "dyke"}
    assert set(names[~low]) == {"host (youngs_modulus 30 GPa)", "dyke (youngs_modulus 30 GPa)"}


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"classes": CLASSES | {"materials": {"W": "granite"}}}, "block_model: 'granite' is not one of the materials"),
        ({"material": "dyke"}, "block_model.classes: give either classes or one material"),
        ({"file": "other.csv"}, "block_model.file: .*other.csv is missing"),
        ({"properties": {"gsi": {"column": "E", "values": [30]}}}, "block_model.properties.gsi: is no number of"),
        ({"properties": {"youngs_modulus": {"column": "E", "unit": "m", "values": [3]}}}, "is not convertible to Pa"),
        ({"properties": {"youngs_modulus": {"column": "E", "values": [3]}}}, "unit: missing key; its numbers are in"),
        ({"properties": {"youngs_modulus": {"column": "E", "unit": "GPa", "values": [3, 2]}}}, "not in ascending"),
        ({"properties": {"poisson_ratio": {"column": "E", "values": [0.2, 0.6]}}}, "0.6 is greater than the maximum"),
        ({"properties": {"cohesion": {"column": "E", "unit": "MPa", "values": list(range(1, 50))},
                         "youngs_modulus": {"column": "E", "unit": "GPa", "values": list(range(1, 50))}}},
         "make 5,000 kinds"),
    ],
)  # fmt: skip
def test_what_is_wrong_in_the_mine_file(refuse, model, values, words):
    line = refuse(model(**values))
    assert re.search(words, line), line


@pytest.mark.parametrize(
    ("table", "header", "words"),
    [
        (rows(rock=lambda x, y, z: "Q" if z > 70 else "W"), HEADER, "no material for Q \\(64 blocks\\)"),
        (rows(rock=lambda x, y, z: "" if z > 70 else "W"), HEADER, "no material for without a class \\(64 blocks\\)"),
        (rows() + rows()[:20], HEADER, "of the blocks overlap others, first at \\(5, 5, 5\\) m"),
        ([row.replace(",10,10,10,", ",5,5,5,") for row in rows()], HEADER, "100 % of the blocks touch no other"),
        ([f"7000{row}" for row in rows()], HEADER, "no cell lies in its blocks"),
        (rows(), HEADER.replace("ROCK", "LITHO"), "no column 'ROCK'"),
    ],
)  # fmt: skip
def test_what_is_wrong_in_the_table(accept, model, table, header, words):
    mine = accept(model(table=table, header=header))
    with pytest.raises(InputError, match=words) as refused:
        grid(mine)
    assert "\n" not in str(refused.value)


def test_gaps_and_few_overlaps_are_named(accept, model, caplog):
    whole = rows()
    with caplog.at_level(logging.WARNING):
        grid(accept(model(table=[*whole[:300], *whole[301:], whole[9]])))
    assert (
        "0.195 % of the blocks overlap others, first at (5, 15, 15) m of the file; the later row counts" in caplog.text
    )
    assert "% of what lies within the blocks is in none, first at" in caplog.text


def test_the_order_of_rows_changes_nothing(accept, model):
    whole = rows(rock=lambda x, y, z: "D" if x + 2 * y < 90 else "W")
    first = grid(accept(model(table=whole)))
    again = grid(accept(model(table=whole[::-1])))
    assert np.array_equal(first.cell_body, again.cell_body)


@pytest.mark.parametrize(
    "frame",
    [
        {"angle": 32.0, "origin": {"grid": [10.0, 20.0, 0.0], "map": [600_000.0, 7_100_000.0, -100.0]}},
        {"axes": ["west", "south"]},
        {"axes": ["north", "east"], "angle": -15.0},
        {"axes": ["east", "north", "down"]},
        {"units": "ft"},
    ],
)
def test_blocks_have_the_coordinates_of_the_mines_grid(model, tmp_path, frame):
    """The rock at a place on the map is that of its coordinates in the grid, turned, mirrored, downward or in feet."""
    model(table=rows(rock=lambda x, y, z: "D" if x + 2 * y + 3 * z < 240 else "W"))
    given = MODEL | {"file": str(tmp_path / "blocks.csv")}
    own = PlacedBlocks.of(given | ({"units": "ft"} if "units" in frame else {}), "block_model")
    placed = PlacedBlocks.of(given | {"grid": frame}, "block_model")
    unit = 0.3048 if "units" in frame else 1.0
    points = unit * np.random.default_rng(3).uniform(-10.0, 90.0, (2000, 3))
    found = read_blocks(placed).kinds_at(placed.grid.map().to_map(points))
    assert len(np.unique(found)) == 3
    assert np.array_equal(found, read_blocks(own).kinds_at(points))


def test_a_mine_that_has_one_depends_on_its_file(accept, model):
    mine = accept(model())
    assert mine.mechanics_slice(0)["refinement"]["blocks"] == mine.grid_slice()["blocks"]


def test_a_plane_strain_scene_has_none(refuse, model):
    model()
    line = refuse(changed(FLAT, **{"block_model": {"file": "blocks.csv", "material": "host"}}))
    assert line.startswith("block_model: a plane strain scene has no block model")


def test_classes_that_are_true_or_false_are_those_of_the_mine_file():
    """A table has numpy's, a YAML file Python's."""
    assert class_text(np.True_) == class_text(True) == "true"
    assert class_text(np.False_) == class_text(False) == "false"
