"""One mine written in several grids: whatever they are, it is the same mine on the map."""

import copy
import json
import re
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import ezdxf
import numpy as np
import pandas as pd
import pytest
import yaml
from pyproj import Transformer
from scipy.spatial import cKDTree
from tiny_mines import FLAT, ROOT, TINY, merged

from catalogs.records import read_record
from catalogs.records.csv_filters import check_codes
from catalogs.records.settings import DomainBox
from catalogs.sources.geographic_frame import MineFrame
from common.errors import InputError
from common.event_table import new_catalog
from common.frame import Frame
from common.voigt import tensor_from_voigt
from mpm_core.scene.scene_solids import read_solids
from mpm_core.settings import GridSlice
from mpm_core.stages.grid_stage import domain_of
from seismic.catalog import write_csv
from workflow.configuration import load
from workflow.map_coordinates import on_map as places_on_map
from workflow.mine import Mine
from workflow.mine_settings import MineSettings
from workflow.run_mine import run_mine

ANGLE = np.radians(32.0)
TURNED = np.array([[np.cos(ANGLE), -np.sin(ANGLE)], [np.sin(ANGLE), np.cos(ANGLE)]])
"""Grid's east and north by the map's: the grid's north points to 32 degrees east of the map's."""
FOOT, SURVEY_FOOT = 0.3048, 1200 / 3937
# The same projections as EPSG:2053 and EPSG:5513, with axes east and north.
LO29 = "+proj=tmerc +lat_0=0 +lon_0=29 +k=1 +x_0=0 +y_0=0 +ellps=WGS84 +units=m +no_defs"
KROVAK = "EPSG:5514"
STRESS = {  # Pa and Pa/m, along east, north and up
    "constant": [-1e5, 0.0, 0.0, 0.0, 0.0, 0.0],
    "gradient": [-24900.0, -36300.0, -27800.0, -700.0, 2700.0, 1300.0],
}
CORNERS = np.array([[x, y, z] for x in (55, 61) for y in (30, 36) for z in (26, 31)], float)
FACETS = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6],
                   [0, 6, 4], [1, 5, 7], [1, 7, 3]])  # fmt: skip
EVENTS = np.random.default_rng(3).uniform(20, 60, (40, 3))


@dataclass(frozen=True)
class Writer:
    """Writes places and components of the map into a grid.

    origin (3,) m: of the grid, from the mine's local origin on the map; axes (2, 2): the grid's x and y by east and
    north; scale: of the map; metres: of the unit; frame: section of the mine file, without the surface.
    """

    origin: tuple[float, float, float]
    frame: dict
    axes: np.ndarray = field(default_factory=lambda: np.eye(2))
    unit: str = "m"
    metres: float = 1.0
    scale: float = 1.0
    up: float = 1.0
    """-1 where z counts downward"""

    def numbers(self, places) -> np.ndarray:
        """Local places (..., 2 or 3) m in the grid, in its unit."""
        own = np.asarray(places, float)
        own = own - np.array(self.origin)[: own.shape[-1]]
        own[..., :2] = own[..., :2] @ self.axes.T / self.scale
        own[..., 2:] *= self.up
        return own / self.metres

    def texts(self, places):
        """The same as a mine file has them."""
        if np.ndim(places) > 1:
            return [self.texts(place) for place in places]
        return [f"{one!r} {self.unit}" for one in self.numbers(places).tolist()]

    def size(self, metres: float) -> str:
        return f"{metres / self.scale!r} m"

    def box(self, lower, upper) -> dict:
        """Keys of the box between two places."""
        ends = np.sort(self.numbers([lower, upper]), axis=0).tolist()
        return {key: [f"{one!r} {self.unit}" for one in end] for key, end in zip(("lower", "upper"), ends, strict=True)}

    def level(self, z: float) -> str:
        return self.texts([0.0, 0.0, z])[2]

    def levels(self, **elevations) -> dict:
        """Lower and upper elevations by their keys; what is lower counts more where z counts downward."""
        texts = {
            key: self.level(z) if isinstance(z, float) else [self.level(one) for one in z]
            for key, z in elevations.items()
        }
        return texts if self.up > 0 else dict(zip(texts, reversed(texts.values()), strict=True))

    def components(self, values, unit: str) -> dict:
        turn = np.diag([1.0, 1.0, self.up])
        turn[:2, :2] = self.axes
        own = turn @ tensor_from_voigt(values) @ turn.T
        names = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "yz": (1, 2), "xz": (0, 2), "xy": (0, 1)}
        return {name: f"{float(own[place])!r} {unit}" if unit else float(own[place]) for name, place in names.items()}

    def vector(self, values) -> list[str]:
        return [f"{one!r} N" for one in [*(self.axes @ values[:2]).tolist(), self.up * float(values[2])]]


def mine_of(writer: Writer, folder, boxes: bool = False) -> dict:
    """A mine with every shape, solids in files, a load, a strain, a face and a record, as a grid has it.

    boxes: with what has to be a box on the map, too.
    """
    folder.mkdir(parents=True, exist_ok=True)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in writer.numbers(CORNERS).tolist()]
    turned = FACETS if np.linalg.det(writer.axes) * writer.up > 0 else FACETS[:, ::-1]
    (folder / "body.obj").write_text("\n".join([*lines, *(f"f {a} {b} {c}" for a, b, c in turned + 1), ""]))
    drawing = ezdxf.new()
    drawing.units = {"m": 6, "ft": 2, "survey_foot": 21, "us_ft": 21}[writer.unit]
    corners = writer.numbers([[60.0, 60.0, 40.0], [66.0, 60.0, 40.0], [66.0, 68.0, 40.0]])
    line = drawing.modelspace().add_polyline3d(corners.tolist(), dxfattribs={"layer": "ROOM"})
    line.close(True)
    drawing.saveas(folder / "room.dxf")
    own = pd.DataFrame(writer.numbers(EVENTS), columns=["x", "y", "z"])
    own.insert(0, "date", [f"2019-08-{1 + number % 30:02d}T06:00:00" for number in range(len(own))])
    own.assign(size=-2.0).to_csv(folder / "record.csv", index=False, float_format="%.12g")
    outline = [[24.0, 24.0], [34.0, 24.0], [34.0, 30.0], [28.0, 34.0]]
    square = [[30.0, 40.0], [45.0, 40.0], [45.0, 55.0], [30.0, 55.0]]
    levels = writer.levels(lower=30.0, upper=36.0)
    mine = {key: copy.deepcopy(TINY[key]) for key in ("name", "materials", "steps", "solver", "seismic", "comparison")}
    mine |= {
        "grid_convergence": False,
        "frame": {"surface": writer.level(1000.0)} | writer.frame,
        "grid": {"finest_cell": "2.5 m"},
        "domain": {"boundary": {"x": "roller", "y": "roller", "z_lower": "fixed"}},
        "insitu_stress": {
            "constant": writer.components(STRESS["constant"], "Pa"),
            "gradient": writer.components(STRESS["gradient"], "Pa/m"),
        },
        "excavations": [
            {"name": "drive", "step": "history", "shape": "tunnel",
             "path": writer.texts([[20.0, 30, 40], [60, 38, 41]]), "width": writer.size(5.0), "height": "4 m"},
            {"name": "raise", "step": "history", "shape": "cylinder", "radius": writer.size(2.0),
             "start": writer.texts([50.0, 50, 20]), "end": writer.texts([52.0, 50, 50])},
            {"name": "cavern", "step": "history", "shape": "sphere", "radius": writer.size(3.0),
             "center": writer.texts([30.0, 65, 40])},
            {"name": "slab", "step": "history", "shape": "prism", "polygon": writer.texts(outline), **levels},
            {"name": "ramp", "step": "history", "shape": "prism", "polygon": writer.texts(outline),
             **writer.levels(base=[50.0, 51.0, 52.0, 50.0], top=[54.0, 55.0, 56.0, 55.0])},
            {"name": "body", "step": "2019-08", "file": "body.obj"},
            {"name": "room", "step": "2019-08", "shape": "prism", "file": "room.dxf", "layer": "ROOM", "height": "4 m"},
            {"name": "stope", "step": "2019-08", "shape": "prism", "polygon": writer.texts(square),
             **writer.levels(lower=25.0, upper=50.0), "fill": "fill"},
        ],
        "rock_bodies": [
            {"name": "dyke", "material": "fill", "shape": "prism", **levels,
             "polygon": writer.texts([[70.0, 20], [72, 20], [72, 70]])},
            {"name": "lens", "material": "fill", "file": "body.obj", "refine": True},
        ],
        "loads": [
            {"name": "push", "step": "2019-08", "force": writer.vector([1e6, 2e6, -3e6]), "shape": "sphere",
             "center": writer.texts([40.0, 20, 30]), "radius": writer.size(4.0)},
            {"name": "pull", "step": "2019-08", "force": "1 MN", "toward": writer.texts([[40.0, 40, 40], [40, 50, 40]]),
             "shape": "sphere", "center": writer.texts([40.0, 20, 30]), "radius": writer.size(4.0)},
        ],
        "strains": [
            {"name": "press", "step": "2019-08", "strain": writer.components([-1e-4, 0, 2e-5, 0, 1e-5, 3e-5], "")},
        ],
        "face": {
            "positions": [
                {"date": "2019-08-01", "ends": writer.texts([[20.0, 20], [20, 60]])},
                {"date": "2019-09-01", "ends": writer.texts([[40.0, 20], [40, 60]])},
            ]
        },
        "record": {"reader": "csv", "file": "record.csv", "location_error": "5 m",
                   "columns": {"time": "date", "x": "x", "y": "y", "z": "z", "log_potency": "size"}},
    }  # fmt: skip
    if boxes:
        mine["domain"] |= writer.box([0.0, -20.0, 0.0], [100.0, 80.0, 80.0])
        mine["grid"] = {"coarse_cell": "10 m", "levels": 3}
        mine["record"]["filter"] = writer.box([25.0, 25.0, 25.0], [55.0, 60.0, 55.0])
        box = writer.box([30.0, 40.0, 52.0], [45.0, 55.0, 58.0])
        mine["excavations"].append({"name": "top", "step": "planned", "shape": "box", **box})
    return mine


def read(mine: dict, folder) -> Mine:
    file = folder / "mine.yaml"
    file.write_text(yaml.safe_dump(mine, sort_keys=False))
    return load(merged(mine), file)


def slices(mine: Mine) -> dict:
    """All that stages depend on, but for the mine's grid itself and the folder of files."""
    found = {
        "grid": mine.grid_slice(),
        "mechanics": mine.mechanics_slice(len(mine.steps) - 1),
        "record": mine.record_slice(),
        "comparison": mine.comparison_slice(),
        "events": mine.events_slice(),
    }

    def plain(value):
        if isinstance(value, dict):
            dropped = {key for key in ("file", "frame") if key in value}
            dropped |= {"grid"} if "file" in value else set()
            return {key: plain(one) for key, one in value.items() if key not in dropped}
        return [plain(one) for one in value] if isinstance(value, list | tuple) else value

    return plain(json.loads(json.dumps(found)))


def differences(one, other, path="") -> list[str]:
    """Where two slices differ: by more than 1e-6 m in lengths, by more than round-off in other numbers."""
    if isinstance(one, dict) and isinstance(other, dict):
        keys = [f"{path}: {one.keys() ^ other.keys()}"] if one.keys() != other.keys() else []
        return keys + [
            line for key in one.keys() & other.keys() for line in differences(one[key], other[key], f"{path}.{key}")
        ]
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        return [
            line for k, pair in enumerate(zip(one, other, strict=True)) for line in differences(*pair, f"{path}[{k}]")
        ]
    if isinstance(one, float | int) and isinstance(other, float | int):
        return [] if abs(one - other) <= 1e-6 + 1e-9 * abs(one) * (abs(one) < 1e5) else [f"{path}: {one!r} {other!r}"]
    return [] if one == other else [f"{path}: {one!r} {other!r}"]


EAST, NORTH = 600_000.0, 7_100_000.0
ON_UTM = Writer((-EAST, -NORTH, 0.0), {"crs": "EPSG:32735"})
SWAP = np.array([[0.0, 1.0], [1.0, 0.0]])
LO29_MINE = Writer((160_000.0, 2_921_000.0, 0.0), {"crs": "EPSG:2053"}, -np.eye(2))
KROVAK_MINE = Writer((650_000.0, 1_050_000.0, 0.0), {"crs": "EPSG:5513"}, -SWAP)


def grid(turn=TURNED, unit="ft", metres=FOOT, scale=1.0, **keys) -> Writer:
    """A grid that is turned by 32 degrees; its elevations count from 1828.8 m below those of the map."""
    origin = (13.0, -40.0, -1828.8)
    point = {"grid": ["0 m"] * 3, "map": [f"{one!r} m" for one in (EAST + 13.0, NORTH - 40.0, -1828.8)]}
    keys = {"units": "us_ft" if unit == "survey_foot" else unit, "angle": "32 deg", "origin": point} | keys
    return Writer(origin, {"crs": "EPSG:32735", "grid": keys}, turn, unit, metres, scale)


def scaled(writer: Writer) -> Writer:
    """The same grid, which states its scale."""
    return replace(writer, frame=writer.frame | {"grid": writer.frame["grid"] | {"scale": writer.scale}})


def by_points(writer: Writer) -> Writer:
    """The same grid by four common points with elevations, in place of its angle, origin and scale."""
    places = np.array([[0.0, 0.0, 0.0], [900.0, 40.0, 100.0], [350.0, 700.0, 30.0], [-200.0, 500.0, 60.0]])
    points = [{"grid": writer.texts(place), "map": ON_UTM.texts(place)} for place in places]
    kept = {key: value for key, value in writer.frame["grid"].items() if key in ("axes", "units")}
    return replace(writer, frame={"crs": "EPSG:32735", "grid": kept | {"points": points}})


GRIDS = {
    "turned, in feet": grid(),
    "turned, in US survey feet": grid(unit="survey_foot", metres=SURVEY_FOOT),
    "turned and mirrored": grid(SWAP @ TURNED, axes=["north", "east"]),
    "turned, x to the west": grid(np.diag([-1.0, 1.0]) @ TURNED, axes=["west", "north"]),
    "turned and scaled, in metres": scaled(grid(unit="m", metres=1.0, scale=0.9996)),
    "turned, z downward": replace(grid(axes=["east", "north", "down"]), up=-1.0),
    "turned and mirrored, z downward": replace(grid(SWAP @ TURNED, axes=["north", "east", "down"]), up=-1.0),
    "by points, z downward": by_points(replace(grid(axes=["east", "north", "down"]), up=-1.0)),
    "by points": by_points(grid()),
    "by points, mirrored": by_points(grid(SWAP @ TURNED, axes=["north", "east"])),
    "by points, scaled": by_points(grid(scale=0.9996)),
}


@pytest.fixture(scope="module")
def on_map(tmp_path_factory) -> Mine:
    """The mine in map coordinates."""
    folder = tmp_path_factory.mktemp("map")
    return read(mine_of(ON_UTM, folder), folder)


@pytest.mark.parametrize("name", GRIDS)
def test_a_turned_grid_is_the_same_mine(name, on_map, tmp_path):
    """Slices to round-off, solids to a micrometre, stress to round-off, events of the record to 1 mm."""
    mine = read(mine_of(GRIDS[name], tmp_path), tmp_path)
    check_same(mine, on_map)


def check_same(mine: Mine, reference: Mine) -> None:
    assert differences(slices(mine), slices(reference)) == []
    for own, other in zip(solids(mine), solids(reference), strict=True):
        for one, two in ((own, other), (other, own)):
            assert cKDTree(one.vertices).query(two.vertices)[0].max() < 1e-6
        assert own.signed_volume == pytest.approx(other.signed_volume, rel=1e-9)
        assert own.is_closed
    stress, expected = (tensor_from_voigt(one.settings.insitu_stress.voigt("gradient")) for one in (mine, reference))
    np.testing.assert_allclose(np.linalg.eigh(stress)[0], np.linalg.eigh(expected)[0], rtol=1e-12)
    np.testing.assert_allclose(stress, expected, atol=1e-8)
    recorded, there = (read_record(one.record_slice()) for one in (mine, reference))
    assert recorded.sizes["event"] == there.sizes["event"] > 0
    np.testing.assert_allclose(recorded["location"], there["location"], atol=1e-3, rtol=0)
    globe, expected = (
        MineFrame(one.settings.frame).to_globe(events["location"].values)
        for one, events in ((mine, recorded), (reference, there))
    )
    np.testing.assert_allclose(globe[:2], expected[:2], atol=1e-7, rtol=0)
    np.testing.assert_allclose(globe[2], expected[2], atol=1e-3, rtol=0)


def solids(mine: Mine) -> list:
    """Surfaces of all solids, as the grid's stage reads them."""
    settings = GridSlice.of(json.loads(json.dumps(mine.grid_slice())))
    domain = domain_of(settings)
    groups = {"excavations": settings.excavations, "rock_bodies": settings.rock_bodies}
    return [one for group, entries in groups.items() for one in read_solids(entries, group, domain, may_miss=True)]


@pytest.mark.parametrize(("writer", "reference"), [(LO29_MINE, LO29), (KROVAK_MINE, KROVAK)], ids=("Lo29", "Krovak"))
@pytest.mark.parametrize("boxes", [False, True])
def test_a_system_whose_axes_run_west_and_south(writer, reference, boxes, tmp_path):
    """South African Lo29 and Krovak, which is mirrored, as files have them: the mine of a system with east and north,
    with its domain, conditions on its sides, and filter."""
    crs = writer.frame["crs"]
    folders = [tmp_path / name for name in ("own", "other")]
    writers = writer, replace(writer, frame={"crs": reference}, axes=np.eye(2))
    mines = [mine_of(one, folder, boxes) for one, folder in zip(writers, folders, strict=True)]
    if boxes:
        sides = ("traction", "roller", "fixed", "free")  # to the west, east, south and north
        mines[1]["domain"]["boundary"] = dict(zip(("x_lower", "x_upper", "y_lower", "y_upper"), sides, strict=True))
        west_south = dict(zip(("x_upper", "x_lower", "y_upper", "y_lower"), sides, strict=True))
        south_west = dict(zip(("y_upper", "y_lower", "x_upper", "x_lower"), sides, strict=True))
        mines[0]["domain"]["boundary"] = west_south if crs == "EPSG:2053" else south_west
    own, other = (read(mine, folder) for mine, folder in zip(mines, folders, strict=True))
    check_same(own, other)
    assert own.grid_text
    assert not other.grid_text
    # by PROJ alone, from the coordinates in the file
    location = read_record(own.record_slice())["location"].values
    written = writer.numbers(location[:, :2] + writer.origin[:2])
    latitude, longitude = Transformer.from_crs(crs, "EPSG:4326").transform(*written.T)
    globe = MineFrame(own.settings.frame).to_globe(location)
    np.testing.assert_allclose(globe[:2], [latitude, longitude], atol=1e-7, rtol=0)


def test_boxes_in_a_grid_that_counts_downward(tmp_path):
    down = replace(ON_UTM, frame=ON_UTM.frame | {"grid": {"axes": ["east", "north", "down"]}}, up=-1.0)
    folders = [tmp_path / name for name in ("down", "up")]
    mines = [read(mine_of(one, folder, True), folder) for one, folder in zip((down, ON_UTM), folders, strict=True)]
    check_same(*mines)
    assert mines[0].grid_text == "In the mine's own grid x runs east and y north, and z down."


LONG_ISLAND = Writer((-300_000.0, -60_000.0, 0.0), {"crs": "EPSG:32118"})  # in metres


def test_a_system_in_feet_is_the_same_in_metres(tmp_path):
    """EPSG:2263 counts EPSG:32118 in US survey feet. Its places are those of PROJ."""
    frame = {"crs": "EPSG:2263", "grid": {"units": "us_ft"}}
    feet = replace(LONG_ISLAND, frame=frame, unit="us_ft", metres=SURVEY_FOOT)
    folders = [tmp_path / name for name in ("feet", "metres")]
    mines = [read(mine_of(one, folder), folder) for one, folder in zip((feet, LONG_ISLAND), folders, strict=True)]
    check_same(*mines)
    location = read_record(mines[0].record_slice())["location"].values
    latitude, longitude = Transformer.from_crs("EPSG:2263", "EPSG:4326").transform(*(location[:, :2] / SURVEY_FOOT).T)
    globe = MineFrame(mines[0].settings.frame).to_globe(location)
    np.testing.assert_allclose(globe[:2], [latitude, longitude], atol=1e-9, rtol=0)


@pytest.mark.parametrize(("third", "is_told"), [([400.0, 800.0], False), ([500.0, 0.0], True), (None, True)])
def test_points_on_one_line_do_not_show_a_mirrored_grid(tmp_path, third, is_told):
    writer = by_points(grid(unit="m", metres=1.0))
    points = [[0.0, 0.0], [900.0, 0.0], *([third] if third else [])]
    frame = {"points": [{"grid": writer.texts(one), "map": ON_UTM.texts(one)} for one in points]}
    mine = read(mine_of(replace(writer, frame={"crs": "EPSG:32735", "grid": frame}), tmp_path), tmp_path)
    assert ("They fit the mirrored grid as well" in mine.grid_text) == is_told


def test_a_grid_upon_lo29_has_its_points_in_the_axes_of_lo29(tmp_path):
    """Map coordinates of common points are those of the system: west and south; the grid's own default is the same."""
    local = Writer((100.0, 50.0, 0.0), {}, -TURNED)  # x and y to the grid's west and south
    corners = [[0.0, 0.0], [500.0, 0.0], [0.0, 400.0]]
    points = [{"grid": local.texts(corner), "map": LO29_MINE.texts(corner)} for corner in corners]
    own = replace(local, frame={"crs": "EPSG:2053", "grid": {"points": points}})
    mines = [read(mine_of(writer, tmp_path / name), tmp_path / name) for name, writer in (("a", own), ("b", LO29_MINE))]
    check_same(*mines)
    grid = mines[0].settings.frame.grid
    assert grid.axes == ("west", "south")
    assert grid.angle == pytest.approx(32.0)
    assert "It misses its 3 common points by at most 0.000 m in plan." in mines[0].grid_text


@pytest.mark.parametrize(
    "writers",
    [
        (GRIDS["turned, in feet"], ON_UTM),
        (GRIDS["turned and mirrored"], ON_UTM),
        (LO29_MINE, replace(LO29_MINE, frame={"crs": LO29}, axes=np.eye(2))),
        (KROVAK_MINE, replace(KROVAK_MINE, frame={"crs": KROVAK}, axes=np.eye(2))),
    ],
    ids=("turned", "mirrored", "Lo29", "Krovak"),
)
def test_the_same_events_in_any_grid(writers, tmp_path):
    """A stope of a few hundred cells, in a grid and in map coordinates: places to 1 mm, potency and mechanisms to
    round-off, latitude and longitude to 1e-7 degrees."""
    catalogues = []
    for name, writer in zip(("grid", "map"), writers, strict=True):
        whole = mine_of(writer, tmp_path / name)
        mine = {key: whole[key] for key in whole if key not in ("loads", "strains", "face", "rock_bodies", "domain")}
        mine["excavations"] = [one for one in whole["excavations"] if one["name"] == "stope"]
        mine["grid"] = {"finest_cell": "5 m", "buffer_cells": 1}
        mine = read(mine, tmp_path / name)
        catalogues.append(run_mine(mine, tmp_path / "failed.npz").catalog)
    own, other = catalogues
    assert own.sizes["event"] == other.sizes["event"] > 10
    np.testing.assert_allclose(own["location"], other["location"], atol=1e-3, rtol=0)
    np.testing.assert_allclose(own["potency"], other["potency"], rtol=1e-6)
    largest = float(own["potency"].max())
    np.testing.assert_allclose(own["potency_tensor"], other["potency_tensor"], atol=1e-6 * largest)
    globes = [MineFrame(one.attrs["frame"]).to_globe(one["location"].values) for one in catalogues]
    np.testing.assert_allclose(globes[0][:2], globes[1][:2], atol=1e-7, rtol=0)


@pytest.mark.parametrize(("place", "asked"), [(-99.0, True), (-9999.0, False)])
def test_a_code_of_missing_values_may_be_a_place_in_the_grid(place, asked):
    """The domain is looked up in the grid: -99 lies in it there, and not on the map."""
    grid = {"axes": ["west", "south"], "origin": {"grid": [0, 0, 0], "map": [0, 0, 0]}}
    settings = SimpleNamespace(
        domain=DomainBox.of({"lower": [50, 0, 0], "upper": [150, 80, 80]}),
        frame=Frame.of({"surface": 0, "grid": grid}),
        columns=SimpleNamespace(x="Y west"),
        file="record.csv",
    )
    with pytest.raises(InputError, match="lies in this domain") if asked else nullcontext():
        check_codes("x", np.array([place]), 1.0, settings)


def test_without_a_grid_nothing_changes(tmp_path):
    """No key more in a slice, and settings that are the same objects, for east and north in either order."""
    mine = read(mine_of(ON_UTM, tmp_path), tmp_path)
    assert mine.catalogue_slice()["frame"] == {"crs": "EPSG:32735", "surface": 1000.0}
    assert not {"mine_grid", "grid_text"} & mine.report_slice().keys()
    for crs in ("EPSG:2193", "EPSG:31467"):
        settings = mine.settings.model_copy(update={"frame": Frame.of({"crs": crs, "surface": 1.0})})
        assert places_on_map(settings).settings is settings


def test_principal_stresses_count_from_the_maps_north(tmp_path):
    """Trend and plunge are bearings, whatever the grid."""
    principal = {
        "sigma_1": {"trend": "30 deg", "plunge": "0 deg", "gradient": "-0.040 MPa/m"},
        "sigma_2": {"trend": "120 deg", "plunge": "0 deg", "gradient": "-0.025 MPa/m"},
        "sigma_3": {"plunge": "90 deg", "gradient": "-0.027 MPa/m"},
    }
    found = []
    for name, writer in (("grid", GRIDS["turned and mirrored"]), ("map", ON_UTM)):
        mine = mine_of(writer, tmp_path / name) | {"insitu_stress": {"principal": principal}}
        found.append(read(mine, tmp_path / name).mechanics_slice(0)["insitu_stress"])
    assert found[0] == found[1]


def test_the_catalogue_has_places_in_the_grid(on_map, tmp_path):
    """Columns with the grid's unit, to 1 mm; none without a grid."""
    writer = GRIDS["turned, in feet"]
    mine = read(mine_of(writer, tmp_path), tmp_path)
    places = EVENTS + np.array([EAST, NORTH, 0.0])
    attributes = {"mine": "tiny", "kind": "synthetic", "location_error": 5.0}
    for one, has_grid in ((mine, True), (on_map, False)):
        frame = json.dumps(one.catalogue_slice()["frame"])
        catalog = new_catalog(len(places), attributes | {"frame": frame}, location=places, potency=np.ones(len(places)))
        write_csv(catalog, tmp_path / "catalog.csv")
        table = pd.read_csv(tmp_path / "catalog.csv")
        np.testing.assert_allclose(table[["x_m", "y_m", "z_m"]], places, atol=6e-4)
        assert [name for name in table if name.startswith("grid_")] == [
            "grid_x_ft",
            "grid_y_ft",
            "grid_z_ft",
        ] * has_grid
        if has_grid:
            own = table[["grid_x_ft", "grid_y_ft", "grid_z_ft"]].to_numpy()
            np.testing.assert_allclose(own, writer.numbers(EVENTS), atol=6e-4, rtol=0)


POINT = {"grid": ["0 m", "0 m"], "map": ["600000 m", "7100000 m"]}
FAR = {"grid": ["200 m", "0 m"], "map": ["600200 m", "7100000 m"]}


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        (
            {"frame.grid": {"angle": "32 deg"}},
            "domain.lower: a box along the mine's grid, which is turned by 32 degrees, is no box along the map's axes; "
            "leave lower and upper out: the domain follows from the openings (grid.finest_cell)",
        ),
        (
            {"frame.grid": {"scale": 0.9996}},
            "domain.lower: frame.grid has the scale 0.9996, so that the sides would be no multiples of the cells; "
            "leave lower and upper out: the domain follows from the openings (grid.finest_cell)",
        ),
        (
            {"frame.grid": {"axes": ["east", "up"]}},
            "frame.grid.axes: give the directions of x and y in plan, then up or down",
        ),
        (
            {"frame.grid": {"points": [POINT, POINT]}},
            "frame.grid.points[1].grid: the same place as an earlier point; give points at different places",
        ),
        (
            {"frame": {"surface": "1000 m", "crs": "EPSG:32735", "grid": {"points": [POINT, FAR], "scale": 0.99}}},
            "frame.grid.points[0]: is missed by 1 m in plan (max_residual 0.5 m); check the coordinates of all points",
        ),
        (
            {"frame": {"surface": "1000 m", "crs": "EPSG:2053", "grid": {"points": [POINT, FAR]}}},
            "frame.grid.points[0].map: lies at latitude",
        ),
        (
            {"frame": {"surface": "1000 m", "crs": "EPSG:2263"}},
            "frame.crs: EPSG:2263: its unit is the US survey foot, and results are in metres; say which unit solids "
            "and record have with frame.grid.units: us_ft, if they have that of the system",
        ),
        (
            {"frame": {"surface": "1000 m", "crs": "EPSG:4326"}},
            "frame.crs: WGS 84: expected a projected system, not a geographic 2d one (degree)",
        ),
        (
            {"frame": {"surface": "1000 m", "crs": "EPSG:3031"}},
            "frame.crs: WGS 84 / Antarctic Polar Stereographic: its axes run north and north, not along a map; give a",
        ),
    ],
)
def test_a_grid_that_cannot_be_is_refused_in_a_line(refuse, changes, line):
    """What, where, what to do."""
    found = refuse(TINY, **changes)
    assert found.startswith(line), found


def test_turned_sides_need_one_condition_and_filters_no_box(refuse):
    """Their lines name the key."""
    mine = {key: value for key, value in TINY.items() if key != "domain"} | {"grid": {"finest_cell": "2.5 m"}}
    turn = {"frame.grid": {"angle": "32 deg"}}
    found = refuse(mine, **turn, **{"domain": {"boundary": {"x": "roller", "z_upper": "free"}}})
    assert found.startswith("domain.boundary: the sides of the domain run along the map's axes, from which the grid is")
    found = refuse(mine, **turn, **{"record.filter": {"lower": ["0 m"] * 3}})
    assert found.startswith("record.filter.lower: a box along the mine's grid")


def test_a_plane_has_no_grid(refuse):
    found = refuse(FLAT, **{"frame.grid": {"units": "ft"}})
    assert found.startswith("plane: xz: a scene in a plane cannot lie in a grid; leave frame.grid out")


def test_mistakes_are_told_in_the_coordinates_of_the_file(refuse):
    """A box that is upside down stays so: no corner is moved before its check."""
    lower = ["20 m", "30 m", "60 m"]
    found = refuse(TINY, **{"frame.grid": {"axes": ["west", "south"]}, "excavations.0.lower": lower})
    assert found.startswith(
        "excavations.drive.upper: upside down: [60.0, 40.0, 50.0] m is not above lower [20.0, 30.0,"
    )


def test_the_examples_of_the_page_are_grids(tmp_path):
    """Each lies on the map as its text says."""
    page = (ROOT / "docs/how-to/mine-grids.md").read_text(encoding="utf-8")
    found = []
    for text in re.findall(r"```yaml\n(.*?)```", page, re.DOTALL):
        mine = mine_of(ON_UTM, tmp_path) | yaml.safe_load(text)
        found.append(places_on_map(MineSettings.read(merged(mine))))
    surfaces = [5600 * FOOT - 100, 1600.0, 1700.0, 20 * SURVEY_FOOT]
    assert [one.settings.frame.surface for one in found] == pytest.approx(surfaces, abs=0.02)
    east_north = ("east", "north")
    assert [one.settings.frame.grid.axes for one in found] == [east_north, east_north, ("west", "south"), east_north]
    assert found[1].settings.frame.grid.angle == pytest.approx(32.0, abs=1e-3)
