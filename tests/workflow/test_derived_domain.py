"""Domain and cells that follow from a mine's file: what is derived, what contradicts, in one line."""

import copy
import json

import ezdxf
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from large_mines import large_mine
from test_configuration import ODD, leaves
from tiny_mines import FLAT, TINY, box, changed, merged, snakemake, write_mine

from common.errors import InputError
from mpm_core.grid.domain import base_cells
from mpm_core.scene.far_field import MAX_BOUNDARY_ERROR, MAX_LIMITED_BOUNDARY_ERROR
from mpm_core.stages.grid_stage import make_grid
from workflow.configuration import load
from workflow.derived_domain import _of_file


def free(mine: dict, cell: str = "2.5 m", **values) -> dict:
    """A mine without a domain, that names its finest cell; its ground far above."""
    mine = {key: value for key, value in copy.deepcopy(mine).items() if key not in ("domain", "record")}
    weightless = {"constant": {"xx": "-1 MPa", "yy": "-1 MPa", "zz": "-1 MPa"}}
    mine |= {"grid": {"finest_cell": cell, "buffer_cells": 1}, "insitu_stress": weightless}
    return changed(mine, **values)


def corners(mine) -> np.ndarray:
    return np.array([mine.settings.domain.lower, mine.settings.domain.upper])


@pytest.mark.parametrize("mine", [TINY, FLAT])
def test_a_domain_follows_from_openings_and_finest_cell(accept, mine):
    """Whole base cells, the distance on every side, and the estimate in grid.nc."""
    made = accept(free(mine))
    grid = made.settings.grid
    lower, upper = corners(made)
    base_cells(lower, upper, grid.coarse_cell)
    assert made.finest_cell == 2.5
    assert made.boundary()["z_upper"] == "fixed"
    assert 0 < made.far_field.error <= MAX_BOUNDARY_ERROR
    boxes = [np.array([made.excavations[1].lower, made.excavations[1].upper])]
    assert min((boxes[0][0] - lower).min(), (upper - boxes[0][1]).min()) >= made.far_field.distance
    dataset = make_grid(made.grid_slice(), {})
    assert dataset.attrs["far_field_error"] == pytest.approx(100 * made.far_field.error)
    assert dataset.attrs["far_field_distance"] == made.far_field.distance
    assert dataset.attrs["fine_cell"] == 2.5


def test_a_planned_stope_and_a_load_count(accept):
    """A stope that gets its month must not make another grid; a load's rock is moved, too."""
    planned = accept(free(TINY))
    dated = accept(free(TINY, **{"excavations.2.step": "2019-08"}))
    assert dated.grid_slice() == planned.grid_slice()
    far = box("push", "2019-08", [400, 20, 20], [410, 30, 30], force=["0 N", "0 N", "-1 MN"])
    assert corners(accept(free(TINY, loads=[far])))[1][0] > 410.0


def test_a_given_domain_takes_the_largest_cells_that_divide_it(accept, refuse):
    """80, 80, 100 m of 1.25 m: 20 m, five levels; and the same by any two of the three sizes."""
    given = {"domain": {"lower": ["0 m"] * 3, "upper": ["80 m", "80 m", "100 m"]}}
    for grid in (
        {"finest_cell": "1.25 m"},
        {"finest_cell": "1.25 m", "levels": 5},
        {"finest_cell": "1.25 m", "coarse_cell": "20 m"},
        {"finest_cell": "1.25 m", "coarse_cell": "20 m", "levels": 5},
    ):
        mine = accept(TINY, **given, grid=grid)
        assert (mine.settings.grid.coarse_cell, mine.settings.grid.levels) == (20.0, 5)
        assert mine.far_field is None
        assert "far_field" not in mine.grid_slice()
    line = refuse(TINY, **given, grid={"finest_cell": "3 m"})
    assert line.startswith(
        "grid.finest_cell: the sides of the domain (80 m, 80 m, 100 m) are no whole multiples of 3 m"
    )


def test_what_is_left_out_is_as_it_was(accept):
    """10 m and four levels, all faces fixed."""
    mine = accept({key: value for key, value in TINY.items() if key != "grid"})
    assert (mine.settings.grid.coarse_cell, mine.settings.grid.levels) == (10.0, 4)
    assert set(mine.boundary().values()) == {"fixed"}


@pytest.mark.parametrize(
    ("grid", "begins"),
    [
        ({"finest_cell": "2 m", "coarse_cell": "10 m", "levels": 4}, "grid.finest_cell: 2 m doubled up to 11 times"),
        ({"finest_cell": "2.5 m", "coarse_cell": "10 m", "levels": 4}, "grid.finest_cell: 2.5 m, but grid.coarse_cell"),
        ({"finest_cell": "20 m", "coarse_cell": "10 m"}, "grid.finest_cell: 20 m doubled up to 11 times"),
        ({"finest_cell": 2}, "grid.finest_cell: 2 has no unit"),
    ],
)
def test_sizes_of_cells_that_contradict_are_refused(refuse, grid, begins):
    """In one line that names all."""
    assert refuse(TINY, grid=grid).startswith(begins)


def test_a_domain_that_cannot_follow_is_refused(refuse):
    """One corner, nothing mined, what lies outside of a solid, or no finest cell."""
    assert refuse(free(TINY), **{"domain": {"lower": ["0 m"] * 3}}).startswith("domain.upper: missing key")
    assert refuse(free(TINY, excavations=[], steps=[])).startswith("domain.lower: missing key; without excavations")
    assert refuse(free(TINY, **{"excavations.0.outside": True})).startswith("excavations.drive.outside: the domain")
    assert refuse(free(TINY, grid={})).startswith("domain: missing key: give lower and upper, or grid.finest_cell")
    assert refuse(free(TINY, **{"excavations.0.radius": "3 m"})).startswith("excavations.drive.radius: not a key of")
    assert refuse(free(TINY, **{"excavations.0.upper": ["0 m"] * 3})).startswith("excavations.drive.upper: upside")


def test_a_shallow_mine_ends_at_the_ground_with_its_top_free(accept, refuse):
    """By itself, or where domain.boundary says so; another condition is refused there, and a free face at depth."""
    shallow = {"frame.surface": "60 m"}
    mine = accept(free(TINY, **shallow))
    assert corners(mine)[1][2] == 60.0
    assert mine.boundary()["z_upper"] == "free"
    assert {mine.boundary()[face] for face in ("x_lower", "x_upper", "y_lower", "z_lower")} == {"fixed"}
    said = accept(free(TINY, **shallow, domain={"boundary": {"z_upper": "free", "others": "roller"}}))
    assert said.boundary()["x_lower"] == "roller"
    assert corners(said)[1][2] == 60.0
    line = refuse(free(TINY, **shallow, domain={"boundary": "fixed"}))
    assert line.startswith("domain.boundary: the domain that is derived ends at frame.surface, 60 m, where z_upper is")
    line = refuse(free(TINY, domain={"boundary": {"z_upper": "free"}}))
    assert line.startswith("domain.boundary: z_upper is free, but the domain that is derived ends at")
    assert (
        corners(accept(free(TINY, plane="xy", excavations=FLAT["excavations"][:1], steps=[], **shallow))).shape[1] == 2
    )


def test_a_solid_of_a_file_counts_with_its_box_and_volume(accept, refuse, tmp_path):
    """As the box itself does; a file that is no solid is refused before anything runs."""
    solid = trimesh.creation.box(bounds=[[30, 40, 25], [45, 55, 50]])
    solid.export(tmp_path / "stope.stl")
    entry = {"name": "stope_1", "step": "2019-08", "fill": "fill", "file": "stope.stl"}
    from_file = accept(free(TINY, **{"excavations.1": entry}))
    np.testing.assert_array_equal(corners(from_file), corners(accept(free(TINY))))
    assert from_file.far_field.radius == pytest.approx(accept(free(TINY)).far_field.radius, rel=1e-3)
    solid.update_faces(solid.face_normals[:, 2] < 0.5)  # its top stands open
    solid.export(tmp_path / "open.stl")
    openings = [_of_file(str(tmp_path / name), "stope_1", (), 0, 0) for name in ("stope.stl", "open.stl")]
    assert openings[1].volume == pytest.approx(openings[0].volume, rel=0.01)
    (tmp_path / "stope.stl").write_text("solid nothing\nendsolid nothing\n")
    assert "stope_1" in refuse(free(TINY, **{"excavations.1": entry}))


def test_the_domain_follows_from_every_outline_of_a_layer(accept, tmp_path):
    """As from prisms of their own; one within another is a hole and adds nothing."""
    document = ezdxf.new()
    panels = [(0, 0, 20), (300, 0, 20), (5, 5, 10)]
    for x, y, width in panels:
        corner = [(x, y), (x + width, y), (x + width, y + width), (x, y + width)]
        document.modelspace().add_lwpolyline(corner, close=True, dxfattribs={"elevation": 40})
    document.saveas(tmp_path / "panels.dxf")
    file = {"shape": "prism", "file": str(tmp_path / "panels.dxf"), "units": "m", "height": "5 m"}
    drawn = accept(free(TINY, excavations=[{"name": "panels", "step": "history"} | file], steps=[]))
    boxes = [
        {"name": f"panel_{x}", "step": "history", "shape": "box", "lower": [f"{x} m", f"{y} m", "40 m"],
         "upper": [f"{x + width} m", f"{y + width} m", "45 m"]}
        for x, y, width in panels[:2]
    ]  # fmt: skip
    np.testing.assert_allclose(corners(drawn), corners(accept(free(TINY, excavations=boxes, steps=[]))))


SHAPES = [
    {"shape": "sphere", "center": ["40 m", "40 m", "40 m"], "radius": "5 m"},
    {"shape": "cylinder", "start": ["40 m", "40 m", "40 m"], "end": ["40 m", "40 m", "60 m"], "radius": "2 m"},
    {"shape": "tunnel", "width": "5 m", "height": "4 m", "path": [["20 m", "30 m", "40 m"], ["60 m", "50 m", "40 m"]]},
    {
        "shape": "prism",
        "lower": "40 m",
        "upper": "60 m",
        "polygon": [["20 m", "30 m"], ["60 m", "50 m"], ["18 m", "34 m"]],
    },
]


@pytest.mark.parametrize("shape", SHAPES, ids=[shape["shape"] for shape in SHAPES])
def test_the_domain_moves_and_mirrors_with_its_openings(accept, shape):
    """By 1,000 km, and in a mirror: the same size, the same place to a finest cell."""

    def placed(value, turn):
        if isinstance(value, list):
            if isinstance(value[0], list):
                return [placed(point, turn) for point in value]
            return [f"{turn(float(part.split()[0]), axis)} m" for axis, part in enumerate(value)]
        return value

    def domain(turn) -> np.ndarray:
        entry = {"name": "drive", "step": "history"} | {key: placed(value, turn) for key, value in shape.items()}
        local = {"frame": {"surface": "9000 m"}}
        return corners(accept(free(TINY, excavations=[entry], steps=[], **local)))

    here = domain(lambda value, axis: value)
    there = domain(lambda value, axis: value + 1e6 * (axis < 2))
    mirrored = domain(lambda value, axis: value * (-1 if axis == 0 else 1))
    np.testing.assert_allclose(there - [1e6, 1e6, 0], here, atol=2.5)
    np.testing.assert_allclose(np.ptp(there, axis=0), np.ptp(here, axis=0), rtol=1e-9)
    np.testing.assert_allclose(mirrored[:, 0], -here[::-1, 0], atol=2.5)
    np.testing.assert_allclose(mirrored[:, 1:], here[:, 1:])


@settings(max_examples=200, deadline=None)
@given(st.sampled_from(list(leaves(free(TINY)))), ODD)
def test_an_odd_value_is_accepted_or_refused_in_one_line(path, value):
    """Also where the domain follows from it: never a traceback, no cell without size."""
    config = free(TINY)
    part = config
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = value
    try:
        mine = load(merged(config), "mine.yaml")
    except InputError:
        return
    json.dumps(mine.grid_slice(), allow_nan=False)
    base_cells(*corners(mine), mine.settings.grid.coarse_cell)


def test_the_domain_of_a_mine_of_five_thousand_stopes_is_derived():
    """Validation reads all of them."""
    mine = large_mine(5000, 200)
    del mine["domain"]
    mine["grid"] = {"finest_cell": "20 m"}
    made = load(merged(mine), "mine.yaml")
    assert made.far_field.distance > 1000.0


def test_a_solid_that_is_read_before_the_run_leaves_the_terminal_to_the_workflow(tmp_path):
    """A drawing without units is logged as it is read; Snakemake's own records must not follow it to the terminal."""
    drawing = ezdxf.new()
    drawing.header["$INSUNITS"] = 0
    for triangle in trimesh.creation.box(bounds=[[30, 40, 25], [45, 55, 50]]).triangles:
        drawing.modelspace().add_3dface([tuple(corner) for corner in triangle])
    drawing.saveas(tmp_path / "stope.dxf")
    entry = {"name": "stope_1", "step": "2019-08", "fill": "fill", "file": "stope.dxf"}
    file = write_mine(free(TINY, **{"excavations.1": entry}), tmp_path / "mine.yaml")
    status, text = snakemake(file, tmp_path, "--dry-run")
    assert status == 0, text
    first, *others = text.splitlines()
    assert "Using workflow specific profile" in first
    assert others[0] == "Job stats:"
    assert text.count("Job stats:") == 1
    assert "snakemake.logging" not in text


DEEP = {"constant": {}, "gradient": {"xx": "-0.006 MPa/m", "yy": "-0.006 MPa/m", "zz": "-0.0278 MPa/m"}}


def deep(cohesion: str, cell: str = "5 m", **values) -> dict:
    """The tiny mine 5 km down, in rock of this cohesion, its domain left out."""
    host = {"materials.host.cohesion": {"intact": cohesion, "residual": "1 MPa"}, "insitu_stress": DEEP}
    return free(TINY, cell, **{"frame.surface": "5040 m", **host, **values})


def test_a_deep_domain_ends_before_virgin_rock_stands_above_its_strength(accept, refuse):
    """By itself, on that side alone, and it says what that costs; where rock by the openings fails, the mine is refused
    by the stress that its file gives."""
    whole, cut = accept(deep("100 MPa")), accept(deep("14.5 MPa"))
    assert (whole.far_field.limited, cut.far_field.limited) == ("", "strength")
    assert corners(whole)[0][2] < corners(cut)[0][2] < 25.0
    assert corners(cut)[0][0] == pytest.approx(corners(whole)[0][0], abs=20.0)
    assert MAX_BOUNDARY_ERROR < cut.far_field.error <= MAX_LIMITED_BOUNDARY_ERROR
    attributes = make_grid(cut.grid_slice(), {}).attrs
    assert attributes["far_field_limited"] == "strength"
    assert attributes["far_field_error"] == pytest.approx(100 * cut.far_field.error)
    line = refuse(deep("14.2 MPa"))
    assert line.startswith("insitu_stress: virgin stress reaches the intact strength of materials.host at elevation")
    line = refuse(deep("8 MPa"))
    assert line.startswith("insitu_stress: at elevation 25 m, the lower end of the excavations, virgin stress is")


def test_a_domain_whose_cells_are_not_given_takes_some_that_divide_it(accept, refuse):
    """The finest as ever, 1.25 m; where no size of ours divides its sides, the key that chooses one is named."""
    mine = {key: value for key, value in TINY.items() if key != "grid"}

    def sides(side: str) -> dict:
        return {"domain": {"lower": ["0 m"] * 3, "upper": ["80 m", "80 m", side]}}

    for side, expected in (("80 m", (10.0, 4)), ("85 m", (5.0, 3)), ("83.75 m", (1.25, 1))):
        grid = accept(mine, **sides(side), solver={"increments": 2}).settings.grid
        assert (grid.coarse_cell, grid.levels) == expected
    assert refuse(mine, **sides("83 m")).startswith(
        "grid.finest_cell: missing key: the sides of the domain (80 m, 80 m"
    )
    line = refuse(TINY, **sides("85 m"), grid={"levels": 2})
    assert line.startswith("grid.finest_cell: missing key: the sides of the domain (80 m, 80 m, 85 m) are no whole")
    assert "of 10 m, the largest of 2 sizes of cell (grid.levels)" in line
    line = refuse(TINY, **sides("85 m"), grid={"levels": 3, "finest_cell": "2.5 m"})
    assert "85 m is not a whole multiple of grid.finest_cell times 2^2 (grid.levels), 10 m" in line


def test_the_cells_of_a_derived_domain_leave_a_preset_its_level(accept, refuse):
    """A draft has larger cells to go to, a fine one smaller, however many finest cells the domain is across."""
    for cell in ("100 m", "40 m", "0.01 m"):
        finest = {name: accept(free(TINY, cell, accuracy=name)).finest_cell for name in ("draft", "standard", "fine")}
        assert finest["draft"] == pytest.approx(2 * finest["standard"])
        assert finest["fine"] == pytest.approx(0.5 * finest["standard"])
    line = refuse(free(TINY, accuracy="draft", **{"grid.levels": 1}))
    assert line.startswith(
        "accuracy: draft: leaves out the finest cells, but all cells are of 2.5 m; use grid.levels: 2"
    )


@pytest.mark.parametrize("swapped", [["a"], ["b"], ["b", "c"]])
def test_an_excavation_far_from_the_others_is_named_and_not_the_cells(refuse, swapped):
    """Coordinates of a map whose x and y are exchanged in some solids; three of five lie in their place."""
    place = np.array([512_345.0, 7_523_456.0, 20.0])
    solids = []
    for number, name in enumerate("abcde"):
        lower = place + np.array([20.0 * number, 0, 0])
        ends = np.array([lower, lower + 10.0])
        ends = ends[:, [1, 0, 2]] if name in swapped else ends
        solids.append(box(name, "history", *ends.tolist()))
    line = refuse(free(TINY, excavations=solids, frame={"surface": "1000 m"}))
    more = f"it and {len(swapped) - 1} more lie" if len(swapped) > 1 else "lies"
    assert line.startswith(f"excavations.{swapped[0]}: {more} ")
    assert "check coordinates, units, scale and offset of both; with x and y exchanged it would lie there" in line


def test_one_excavation_too_large_for_its_cells_is_not_far_from_others(refuse):
    large = [box("a", "history", [0, 0, 20], [99_000, 99_000, 30])]
    line = refuse(free(TINY, excavations=large, frame={"surface": "1000 m"}))
    assert line.startswith("grid.finest_cell: the largest cells")


def test_a_rock_body_outside_a_derived_domain_is_left_out(accept):
    """Its place is the user's, the domain is not."""
    dyke = box("dyke", "history", [9000, 0, 0], [9100, 80, 80]) | {"material": "fill"}
    dyke.pop("step")
    dataset = make_grid(accept(free(TINY, "5 m", rock_bodies=[dyke])).grid_slice(), {})
    assert (dataset["cell_body"] == -1).all()


def test_an_excavation_above_the_ground_is_named(refuse):
    """Not the domain, which is ours."""
    line = refuse(free(TINY, **{"excavations.2": box("tower", "planned", [20, 30, 1040], [60, 40, 1050])}))
    assert line.startswith("excavations.tower: lies above the ground, z 1040 m and more (frame.surface: 1000 m)")


def layout(seed: int) -> dict:
    """A mine of some excavations 5 m to 5 km down, in rock that may or may not bear it, with what sizes of cells and
    faces its file may give: its domain is ours."""
    random = np.random.default_rng(seed)
    size, depth = 10 ** random.uniform(0.5, 2), 10 ** random.uniform(0.7, 3.7)

    def opening(number: int) -> dict:
        middle = np.append(random.uniform(-3, 3, 2) * size, 1000 - depth + random.uniform(-1, 1) * size)
        half = size * random.uniform(0.2, 0.6, 3)
        return box(f"stope_{number}", "history", (middle - half).round(3).tolist(), (middle + half).round(3).tolist())

    cell, cohesion = float(f"{size * random.choice([0.05, 0.2, 1.5]):.3g}"), 10 ** random.uniform(0, 2)
    stress = {
        axis: f"{-0.0278 * ratio:.5f} MPa/m"
        for axis, ratio in zip(("xx", "yy"), random.uniform(0.2, 2.5, 2), strict=True)
    }
    grid = {"finest_cell": f"{cell} m"} | random.choice(
        [
            {},
            {},
            {},
            {"levels": int(random.integers(1, 13))},
            {"coarse_cell": f"{cell * 2 ** random.integers(0, 12)} m"},
        ]
    )
    faces = random.choice(
        [{}, {}, {}, {"domain": {"boundary": "roller"}}, {"domain": {"boundary": {"z_upper": "free"}}}]
    )
    mine = {key: value for key, value in TINY.items() if key not in ("domain", "record", "steps", "excavations")}
    return changed(
        mine | {"grid": grid, "accuracy": str(random.choice(["draft", "standard", "fine"]))} | faces,
        **{
            "excavations": [opening(number) for number in range(random.integers(1, 6))],
            "insitu_stress": {"constant": {}, "gradient": {"zz": "-0.0278 MPa/m"} | stress},
            "materials.host.cohesion": {"intact": f"{cohesion:.3g} MPa", "residual": "0.1 MPa"},
        },
    )


def is_written(mine: dict, key: str) -> bool:
    """Whether a mine's file has a key; entries of lists by name."""
    for name in key.split("."):
        named = {entry["name"]: entry for entry in mine} if isinstance(mine, list) else mine
        if not isinstance(named, dict) or name not in named:
            return False
        mine = named[name]
    return True


def test_what_is_derived_fits_or_the_refusal_names_what_the_file_says():
    """Never a corner of the domain or a size of cell that nobody wrote."""
    accepted = 0
    for seed in range(300):
        mine, line = layout(seed), ""
        try:
            made = load(merged(mine), "mine.yaml")
        except InputError as refused:
            line = str(refused).removeprefix("mine.yaml: ")
        if line:
            assert is_written(mine, line.split(": ")[0]), line
            continue
        accepted += 1
        base_cells(*corners(made), made.settings.grid.coarse_cell)
    assert accepted > 200
