"""The section of warnings: what it names, from which size on, and once."""

import json

import numpy as np
import pytest
import report_fixtures as fixtures
import xarray as xr

from catalogs.report.sections.warnings import banners
from catalogs.report.text import number
from common.datasets import read_dataset, write_dataset
from common.voigt import voigt_from_tensor

pytestmark = pytest.mark.usefixtures("without_drawing")


def warnings_of(mine: fixtures.Mine, **changes) -> str:
    """The banners of a report, as they stand in its section of warnings."""
    return "\n".join(one.text for one in banners(fixtures.evidence_of(**mine.arguments(**changes))))


def test_loose_rock_is_named_before_anything_else(page):
    """Count, volume and place of the step's attributes, once: steps without loose rock say nothing."""
    assert page.sections["warnings"].count("Unsupported rock in step") == 1
    expected = "2019-09: 3 pieces, 1.20 m³, largest 0.7 m³ at (x, y, z) = (10052.0, 20051.5, −1020.2) m, counts as"
    assert expected in page.sections["warnings"]


def test_banners_name_truncation(page):
    assert "of potency is missing from the 0.629 m³" in page.sections["warnings"]
    assert "3.4 % of the rock that reached its strength lies in cells too coarse to fail" in page.sections["warnings"]


def test_stopes_filled_while_they_are_mined_are_named(page):
    """Only stope_1 is mined in a dated step and filled in the same one; the table says of each when it is filled."""
    assert "These excavations are filled while they are mined: stope_1. " in page.sections["warnings"]
    assert "fill, at once" in page.sections["scene"]
    assert "fill, planned" in page.sections["scene"]


def test_every_banner_stands_in_the_section_of_warnings(page, mine):
    """Each text once, with what it says; the tests below read the texts themselves."""
    texts = [one.text for one in banners(fixtures.evidence_of(**mine.arguments()))]
    assert len(texts) > 2
    assert all(page.sections["warnings"].count(text) == 1 for text in texts)


def test_banner_names_excavations_whose_volume_the_grid_misses(mine, tmp_path):
    """By more than 5 %, the worst first; a planned one does not count yet, and 4.9 % is no matter."""
    grid = read_dataset(mine.grid)
    solid = np.array(json.loads(grid.attrs["excavation_volume"]))
    grid.attrs["excavation_volume_grid"] = json.dumps((solid * [1.049, 0.93, 1.18, 9.0]).tolist())
    write_dataset(grid, tmp_path / "grid.nc")
    wrong = warnings_of(mine, grid=tmp_path / "grid.nc")
    assert "misses the volume of 2 excavations by more than 5.0 %: stope_2 +18 %, stope_1 −7 %. Refine" in wrong
    grid.attrs["excavation_volume_grid"] = json.dumps((solid * 1.049).tolist())
    write_dataset(grid, tmp_path / "good.nc")
    assert "misses the volume" not in warnings_of(mine, grid=tmp_path / "good.nc")


def test_banner_names_excavations_too_narrow_for_the_cells(mine, tmp_path):
    """The narrowest first; a planned one does not count yet."""
    grid = read_dataset(mine.grid)
    narrow = {"excavation_narrow": json.dumps(["stope_1", "stope_2", "stope_3"])}
    across = {"excavation_cells_across": "[4.0, 2.5, 1.2, 1.0]", "excavation_cells_needed": "[4, 4, 4, 2]"}
    write_dataset(grid.assign_attrs(narrow | across), tmp_path / "grid.nc")
    said = warnings_of(mine, grid=tmp_path / "grid.nc")
    assert "by cells across and how many are needed: stope_2 1.2 of 4, stope_1 2.5 of 4. The walls" in said
    assert "Cells of 1.2 m are small enough." in said  # 1.2 cells of 4 m are 4.8 m
    assert "Narrow for" not in warnings_of(mine)


def test_banner_names_excavations_whose_fill_holds_no_walls(mine, tmp_path):
    """By the last step. In one that is wide the nodes are those of its edges; one without fill in this run is no part
    of the number."""
    grid = read_dataset(mine.grid)
    across = {"excavation_cells_across": "[4.0, 2.0, 6.0, 2.0]", "excavation_cells_needed": "[4, 2, 4, 2]"}
    write_dataset(grid.assign_attrs(across), tmp_path / "grid.nc")
    arguments = mine.arguments(grid=tmp_path / "grid.nc")
    last = read_dataset(arguments["steps"][-1])
    unheld = json.dumps({"stope_1": 30, "stope_2": 12})
    write_dataset(last.assign_attrs(unheld_fill=unheld), tmp_path / "last.nc")
    arguments["steps"] = [*arguments["steps"][:-1], tmp_path / "last.nc"]
    evidence = fixtures.evidence_of(**arguments)
    (found,) = [one for one in banners(evidence) if "Fill does not hold" in one.text]
    assert found.text.startswith("Fill does not hold the walls of 1 of 1 filled excavation, at 30 nodes: stope_1.")
    brief = "cells too large for fill to touch the walls of 1 of 1 filled excavation"
    assert found.brief == f"{brief} (the grid's limit, not the mine's)"
    assert found.mend.code == "grid.finest_cell: 2 m"  # two cells of 4 m are 8 m
    assert [row.unheld for row in evidence.excavations] == [0, 30, 0, 0]
    assert not [one for one in banners(fixtures.evidence_of(**mine.arguments())) if "Fill does" in one.text]


def test_banner_names_excavations_whose_surface_is_open(mine, tmp_path):
    """The most open first; a planned one does not count yet, and 4 % is no matter."""
    grid = read_dataset(mine.grid)
    grid.attrs["excavation_open_share"] = json.dumps([0.04, 0.08, 0.22, 0.25])
    write_dataset(grid, tmp_path / "grid.nc")
    said = warnings_of(mine, grid=tmp_path / "grid.nc")
    assert "or look the other way: stope_2 22 %, stope_1 8.0 % of the volume depends on how it is closed." in said
    assert "depends on how it is closed" not in warnings_of(mine)


def test_banner_says_where_failed_rock_has_reached_the_boundary(mine, tmp_path):
    """Of the step in which most of it lies there."""
    steps = []
    for rank, path in enumerate(mine.steps):
        facts = {"boundary_failed_volume": 64.0 * rank, "boundary_failed_faces": "z_lower" if rank else ""}
        steps.append(tmp_path / path.name)
        write_dataset(read_dataset(path).assign_attrs(facts), steps[-1])
    said = warnings_of(mine, steps=steps)
    assert "(z_lower; " + number(64.0 * (len(steps) - 1)) + " m³ of its cells lie there in step 2019-09)" in said
    assert "boundary (" not in warnings_of(mine)


def test_a_draft_says_so_first(tmp_path, mine):
    page = tmp_path / "report.html"
    where = {"output": page, "figures": tmp_path / "figures"}
    fixtures.write_page(**mine.arguments(config=fixtures.CONFIG | {"accuracy": "draft"}, **where))
    said = page.read_text()
    assert "A draft has cells of twice the size" in said
    draft = said.index("<strong>Do not use these numbers yet:</strong> this is a draft")
    assert draft < said.index('<p class="lead">') < said.index("A draft has")
    assert "A draft has" not in warnings_of(mine, config=fixtures.CONFIG | {"accuracy": "standard"})
    grid = read_dataset(mine.grid).assign_attrs(draft_would_lose='["stope_a", "drive"]')
    write_dataset(grid, tmp_path / "kept.nc")
    kept = warnings_of(mine, config=fixtures.CONFIG | {"accuracy": "draft"}, grid=tmp_path / "kept.nc")
    assert "A draft has looser tolerances" in kept
    assert "hardly any cell of twice the size would lie wholly in stope_a and 1 other excavation" in kept


def test_banner_names_excavations_whose_surface_encloses_nothing(mine, tmp_path):
    """Without a thickness no size of cells follows from them, nor from fill in them; from the others one does."""
    grid = read_dataset(mine.grid)
    narrow = {"excavation_narrow": json.dumps(["stope_1", "stope_2"])}
    last = read_dataset(mine.steps[-1]).assign_attrs(unheld_fill=json.dumps({"stope_1": 30}))
    write_dataset(last, tmp_path / "last.nc")
    steps = [*mine.steps[:-1], tmp_path / "last.nc"]
    for number_of_cells, size in (("[4.0, 0.0, 1.2, 1.0]", "1.2"), ("[4.0, 0.0, 0.0, 1.0]", "")):
        across = {"excavation_cells_across": number_of_cells, "excavation_cells_needed": "[4, 2, 4, 2]"}
        write_dataset(grid.assign_attrs(narrow | across), tmp_path / "grid.nc")
        found = banners(fixtures.evidence_of(**mine.arguments(grid=tmp_path / "grid.nc", steps=steps)))
        said = {one.brief.partition(":")[0]: one for one in found}
        names = "stope_1" if size else "stope_1, stope_2"
        assert f"encloses nothing, as a repeated sheet does: {names}. How" in said["surface encloses nothing"].text
        (fill,) = [one for one in found if "Fill does not hold" in one.text]
        assert "still open. Fill in the step that mines." in fill.text
        assert (fill.mend is None) == (not size)
        if size:
            assert fill.mend.code == f"grid.finest_cell: {size} m"
        else:
            assert not [one for one in found if "Narrow for" in one.text]


def _with_bands(evidence, along: int, mirrored: int):
    """Evidence whose failed rock is so many sheets along the grid and along their mirror images, and nothing else.

    The planes of shear of all of them have the same two directions: level, and dipping by 60 degrees.
    """
    cell = float(evidence.grid.attrs["fine_cell"])
    axis = np.arange(-5, 6)
    index = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    level, dipping = np.array([0.0, 0.0, 1.0]), np.array([0.0, np.sqrt(0.75), 0.5])
    places = []
    for which in range(along + mirrored):
        normal = level if which < along else dipping
        sheet = index[np.abs(index @ normal) <= 0.5 * normal.max()]
        places.append(cell * (sheet + np.array([20 * which, 0, 0])))
    place = np.concatenate(places)
    tension, pressure = (level - dipping) / np.linalg.norm(level - dipping), (level + dipping) / np.sqrt(3.0)
    strain = voigt_from_tensor(np.outer(tension, tension) - np.outer(pressure, pressure))
    count = len(place)
    evidence.state = xr.Dataset(
        {
            "position": (("particle", "xyz"), place),
            "failed": ("particle", np.zeros(count, np.int32)),
            "volume": ("particle", np.full(count, cell**3)),
            "plastic_strain": (("particle", "voigt"), np.tile(strain, (count, 1))),
        },
        attrs={"plane": "none"},
    )
    return [one.text for one in banners(evidence) if "thin bands along the axes" in one.text]


@pytest.mark.parametrize(
    ("along", "mirrored", "said"),
    [(12, 1, "Chance seldom"), (2, 0, "may differ by chance"), (4, 4, ""), (0, 6, ""), (3, 12, "")],
)
def test_bands_along_the_grid_are_told_where_their_mirror_images_are_fewer(mine, along, mirrored, said):
    found = _with_bands(fixtures.evidence_of(**mine.arguments()), along, mirrored)
    assert len(found) == bool(said)
    assert not found or said in found[0]
    assert not found or f"in {along} bands" in found[0]


def test_banner_names_excavations_with_nothing_left_to_mine(mine, tmp_path):
    """A pushback of which an earlier step has mined all: its pieces are those of the one before."""
    assert "nothing is left to mine" not in warnings_of(mine)
    grid = read_dataset(mine.grid)
    first = np.flatnonzero(grid["piece_excavation"].values == 0)
    again = grid.isel(piece=first).assign(piece_excavation=("piece", np.full(len(first), 1, np.int16)))
    own = grid.isel(piece=np.flatnonzero(grid["piece_excavation"].values != 1))
    both = {
        name: (grid[name].dims, np.concatenate([own[name].values, again[name].values]))
        for name in grid
        if "piece" in grid[name].dims
    }
    order = np.argsort(both["piece_excavation"][1], kind="stable")
    rest = grid.drop_vars(list(both))
    write_dataset(
        rest.assign({name: (dims, values[order]) for name, (dims, values) in both.items()}), tmp_path / "g.nc"
    )
    said = warnings_of(mine, grid=tmp_path / "g.nc")
    assert "stope_1: nothing is left to mine there. Others have mined all of it" in said
