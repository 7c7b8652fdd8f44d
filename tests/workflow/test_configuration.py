"""A mine's configuration: every mistake is one line that names file and key."""

import copy
import datetime
import json

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from tiny_mines import DEFAULT, DIRECTED, FILL, FLAT, HOST, NEXT_STEP, PUSH, STRAIN, TINY, box, changed, merged

from catalogs.record_settings import COLUMN_KEYS, RecordSlice
from catalogs.records.filters import limits_of
from pipeline.errors import InputError
from workflow.configuration import load
from workflow.draft import draft_of

IN_FILE = {key: DIRECTED[key] for key in ("name", "step", "force", "toward")} | {"file": "record.csv"}
UPSIDE_DOWN = {"shape": "prism", "lower": "50 m", "upper": "40 m"}
ELEVATIONS = {"lower": "40 m", "upper": "50 m"}
TRIANGLE = [["20 m", "30 m"], ["60 m", "30 m"], ["60 m", "40 m"]]
PRISM = {"name": "drive", "step": "history", "shape": "prism", "polygon": TRIANGLE, **ELEVATIONS}
ENDS = {"start": ["20 m", "30 m", "40 m"], "end": ["60 m", "30 m", "40 m"]}
ROUND = {"name": "drive", "step": "history", "shape": "cylinder", "radius": "4 m", **ENDS}
AGAIN = TINY["excavations"][1] | {"name": "stope_1_again"}
BEYOND = box("stope_2", "planned", [145, 40, 25], [155, 55, 50])
BOX = {"lower": ["20 m", "20 m", "20 m"], "upper": ["60 m", "60 m", "60 m"]}
FAR = {"lower": ["500 km", "5372 km", "0 m"], "upper": ["500080 m", "5372080 m", "80 m"]}  # eastings and northings
UTM = {"crs": "EPSG:32755", "surface": "1000 m"}  # of a domain near zero
IN_DRAWING = {"name": "stope_1", "step": "2019-08", "file": "record.csv"}
SHAFT = {"name": "drive", "step": "history", "shape": "tunnel", "width": "6 m", "height": "4 m"} | {
    "path": [["20 m", "30 m", "40 m"], ["40 m", "30 m", "40 m"], ["40 m", "30 m", "60 m"]]
}
LOW_ARCH = SHAFT | {"path": SHAFT["path"][:2], "profile": "arched", "height": "2 m"}
BOW_TIE = [["20 m", "30 m"], ["40 m", "40 m"], ["40 m", "30 m"], ["20 m", "40 m"]]
ON_GLOBE = {"time": "date", "latitude": "x", "longitude": "y", "depth": "z", "log_potency": "size"}
QUAKEML = {"reader": "quakeml", "file": "record.csv", "location_error": "5 m"}
ELK_CREEK = QUAKEML | {"reader": "elk_creek"}
BALL = {"name": "stope_1", "step": "2019-08", "shape": "sphere", "center": ["40 m", "40 m", "40 m"]}
FAULTS = [  # key set, value, what the line begins with, what it says besides
    ("grid.levles", 3, "grid.levles: unknown key", "did you mean levels?"),
    ("seismic.cluster.radius", 2, "seismic.cluster.radius: unknown key", "radius_cells"),
    ("materials.host.colour", "red", "materials.host.colour: unknown key", "known here"),
    ("excavations.0.radios", "3 m", "excavations[0].radios: unknown key", "radius"),
    ("materials.host.youngs_modulus", "57 GPa/m", "materials.host.youngs_modulus: ", "not convertible to Pa"),
    ("materials.host.density", "2850 kg", "materials.host.density: ", "not convertible to kg/m^3"),
    ("materials.host.youngs_modulus", 57e9, "materials.host.youngs_modulus: ", "no unit"),
    ("materials.host.youngs_modulus", "57", "materials.host.youngs_modulus: ", "no unit"),
    ("materials.host.youngs_modulus", "57 GPs", "materials.host.youngs_modulus: ", "GPs"),
    ("domain.upper.0", 80, "domain.upper[0]: ", "no unit"),
    ("insitu_stress.gradient.xx", "-0.02 MPa", "insitu_stress.gradient.xx: ", "not convertible to Pa/m"),
    ("materials.host.youngs_modulus", "-57 GPa", "materials.host.youngs_modulus: ", "out of range"),
    ("materials.host.poisson_ratio", 0.5, "materials.host.poisson_ratio: ", "0.5"),
    ("materials.host.cohesion.residual", "2 MPa", "materials.host.cohesion: ", "residual 2e+06 is above intact 1e+06"),
    ("materials.host.friction_angle.residual", "40 deg", "materials.host.friction_angle: ", "above intact"),
    ("materials.host.tension_cutoff.residual", "1 MPa", "materials.host.tension_cutoff: ", "above intact"),
    ("materials.host.dilation_angle.intact", "35 deg", "materials.host.dilation_angle.intact: ", "allow_psi_above_phi"),
    ("materials.fill.cohesion", HOST["cohesion"], "materials.fill.cohesion: ", "not a key of this model"),
    ("materials.host.model", "plastic", "materials.host.model: ", "not one of elastic, coulomb"),
    ("excavations.1.step", "2019-13", "excavations.stope_1.step: ", "not one of the steps history, 2019-08, planned"),
    ("excavations.1.filled", "history", "excavations.stope_1.filled: ", "before the excavation is mined"),
    ("excavations.0.pressure", 5, "excavations[0].pressure: ", "no unit"),
    ("excavations.0.pressure", "-5 MPa", "excavations[0].pressure: ", "out of range"),
    ("excavations.0.pressure", {}, "excavations[0].pressure: ", "non-empty"),
    ("excavations.0.pressure", {"history": "5 m"}, "excavations[0].pressure.history: ", "not convertible to Pa"),
    ("excavations.0.pressure", {"2019-13": "5 MPa"}, "excavations.drive.pressure.2019-13: ", "not one of the steps"),
    ("excavations.1.pressure", "5 MPa", "excavations.stope_1.pressure: ", "filled by then"),
    ("excavations.1.pressure", {"history": "5 MPa"}, "excavations.stope_1.pressure.history: ", "before"),
    ("excavations.1.fill", "paste", "excavations.stope_1.fill: ", "not one of the materials host, fill, none"),
    ("excavations.0.filled", "2019-08", "excavations.drive.filled: ", "no fill"),
    ("excavations.1.name", "drive", "excavations.drive: ", "twice"),
    ("excavations.1.file", "stope.stl", "excavations.stope_1: ", "either a shape or a file"),
    ("excavations.0.radius", "3 m", "excavations.drive.radius: ", "not a key of box; its keys are lower, upper"),
    ("excavations.0.shape", "tunnel", "excavations.drive.height: ", "missing; shape tunnel needs height, path, width"),
    ("excavations.0.name", "../etc", "excavations[0].name: ", "does not match"),
    ("steps.1.name", "planned", "steps.planned: ", "another name"),
    ("steps.1.end", "2019-08-01", "steps.2019-08.end: ", "not after start"),
    ("steps.1.end", "2019-08-32", "steps.2019-08.end: ", "not a date"),
    ("steps.1.start", "August", "steps[1].start: ", "'August'"),
    ("steps.1.name", 201908, "steps[1].name: ", 'put the name in quotes: "201908"'),
    ("name", "x y", "name: ", "letters, digits"),
    ("name", "x" * 300, "name: ", "up to 64 letters"),
    ("name", "verification", "name: results/verification", "another name"),
    ("materials.fill", "x", "materials.fill: ", "'object'"),
    ("materials." + "m" * 65, FILL, "materials", "up to 64 letters"),
    ("steps.1.name", "History", "steps.History: ", "capitals alone"),
    ("steps.1.end", "2262-08-01", "steps.2019-08.end: ", "1678 to 2261"),
    ("steps.1.start", "1677-12-31", "steps.2019-08.start: ", "1678 to 2261"),
    ("steps.1.start", "2019-09-01 06:00", "steps.2019-08.end: ", "not after start"),
    ("steps.1.end", "2019-08-01T00:00:00Z", "steps.2019-08.end: ", "not after start"),
    ("domain.upper", ["80 m", "80 m", "-80 m"], "domain.upper[2]: ", "not above domain.lower[2]"),
    ("domain.upper.0", "1e300 m", "domain.upper[0]: ", "out of range"),
    ("grid.coarse_cell", "1e-5 m", "grid.coarse_cell: ", "5e+20 coarse cells"),
    ("frame", {"surface": "1000 m", "latitude": 1}, "frame: latitude: give latitude and longitude", "or none"),
    ("frame.crs", "EPSG:28355", "frame: crs and latitude and longitude: give", "or crs"),
    ("solver.hourglass", 0, "solver.hourglass: ", "0.001 to 1, or more grid.particles_per_cell"),
    ("comparison.seed", "1e400", "comparison.seed: inf", "not a finite number"),
    ("comparison.seed", 10**400, "comparison.seed: an integer of 20 digits or more", "not a finite number"),
    ("comparison.block_days", "1e400", "comparison.block_days: inf", "not a finite number"),
    ("materials.host.youngs_modulus", "57 GPa*9**9**9", "materials.host.youngs_modulus: ", "without arithmetic"),
    ("materials.host.youngs_modulus", "5" * 500 + " Pa", "materials.host.youngs_modulus: ", "503 characters"),
    ("insitu_stress.constant", {"xx": "30 MPa"}, "insitu_stress: xx is positive", "compression is negative"),
    ("insitu_stress.gradient.zz", "0.0278 MPa/m", "insitu_stress.gradient.zz: ", "compression is negative"),
    ("excavations.0.upper", ["60 m", "40 m", "30 m"], "excavations.drive.upper: upside down", "not above lower"),
    ("excavations.0.upper", ["60 m", "40 m"], "excavations.drive.upper: ", "2 coordinates; this scene has 3"),
    ("excavations.0", PRISM | {"upper": "30 m"}, "excavations.drive.upper: upside down", "not above lower"),
    ("excavations.0", PRISM | {"base": ["40 m"] * 3}, "excavations.drive: ", "lower and upper, or base and top"),
    ("excavations.0", PRISM | {"polygon": [*TRIANGLE[:2], TRIANGLE[0]]}, "excavations.drive.polygon: ", "on one line"),
    ("record.file", "r" * 300, "record.file: ", "missing"),
    ("excavations.0", ROUND | {"end": ["20 m", "30 m", "40 m"]}, "excavations.drive.end: ", "same point"),
    ("excavations.0", ROUND | {"radius": "1e300 m"}, "excavations[0].radius: ", "out of range"),
    ("excavations.0", ROUND | {"shape": "circle"}, "excavations.drive.shape: ", "not one of the 3-D shapes"),
    ("excavations.0.file", "s" * 400, "excavations.drive: ", "either a shape or a file"),
    ("excavations.2", AGAIN, "excavations.stope_1_again: ", "the same solid as excavations.stope_1"),
    ("excavations.2", BEYOND, "excavations.stope_2: lies outside the domain", "(145 to 155 m, 40 to 55 m, 25 to 50 m"),
    ("domain.upper", ["80 m", "80 m", "85 m"], "domain.upper[2]: ", "not a whole multiple of grid.coarse_cell, 10 m"),
    ("domain.upper", ["80 m", "80 m"], "domain.upper: ", "2 coordinates; this scene has 3"),
    ("domain.boundary", "free", "domain.boundary: ", "no face holds the rock up"),
    ("domain.boundary", {"x": "roller", "x_lower": "free"}, "domain.boundary.x_lower: ", "also given by 'x'"),
    ("grid.particles_per_cell", 4, "grid.particles_per_cell: ", "n^3"),
    ("insitu_stress.gradient.yy", "-0.363 MPa/m", "insitu_stress: ", "above the intact strength of materials.host"),
    ("record.filter", {"start": "2019-06-31"}, "record.filter.start: ", "not a date"),
    ("loads", [PUSH, PUSH], "loads.push: ", "twice"),
    ("loads", [PUSH | {"file": "push.stl"}], "loads.push: ", "either a shape or a file"),
    ("loads", [PUSH | {"force": "1 MN"}], "loads.push.force: ", "add toward"),
    ("loads", [PUSH | {"toward": ["0 m", "0 m", "0 m"]}], "loads.push.force: ", "single magnitude"),
    ("loads", [DIRECTED | {"toward": ["0 m", "0 m"]}], "loads.push.toward: ", "2 coordinates; this scene has 3"),
    ("loads", [DIRECTED | {"toward": [["0 m", "0 m", "0 m"]] * 2}], "loads.push.toward: ", "two different"),
    ("loads", [DIRECTED | {"toward": [["0 m", "0 m", "0 m"], ["0 m", "1 m"]]}], "loads.push.toward: ", "2 coordinates"),
    ("solver.weakest_first", 1.5, "solver.weakest_first: ", "1"),
    ("solver.collapse", "forgive", "solver.collapse: ", "not one of error, keep"),
    ("loads", [DIRECTED | {"force": "-1 MN"}], "loads[0].force: ", "out of range"),
    ("loads", [DIRECTED | {"force": "1 m"}], "loads[0].force: ", "not convertible to N"),
    ("loads", [DIRECTED | {"step": "2019-13"}], "loads.push.step: ", "not one of the steps"),
    ("loads", [IN_FILE], "loads.push.file: ", "a load acts on a shape"),
    ("excavations.0.outside", "yes", "excavations[0].outside: ", "'yes'"),
    ("strains", [STRAIN, STRAIN], "strains.press: ", "twice"),
    ("strains", [STRAIN | {"step": "2019-13"}], "strains.press.step: ", "not one of the steps history, 2019-08"),
    ("strains", [STRAIN | {"strain": {"xx": "1 MPa"}}], "strains[0].strain.xx: ", "'1 MPa'"),
    ("strains", [STRAIN | {"strain": {"xx": 3.0}}], "strains[0].strain.xx: ", "0.5"),
    ("strains", [STRAIN | {"strain": {}}], "strains[0].strain: ", "non-empty"),
    ("strains", [STRAIN | {"strain": {"rr": 1e-4}}], "strains[0].strain.rr: unknown key", "known here: xx, yy"),
    ("record.file", "nowhere.csv", "record.file: ", "missing"),
    ("record.filter", {"start": "0001-01-01"}, "record.filter.start: ", "a year from 1678 to 2261"),
    ("record.filter", {"start": "2019-08-02", "end": "2019-08-02"}, "record.filter.end: ", "not after start"),
    ("record.filter", {"lower": ["0 m", "0 m"]}, "record.filter.lower: ", "2 coordinates"),
    (
        "record.filter",
        BOX | {"upper": ["60 m", "60 m", "10 m"]},
        "record.filter.upper: ",
        "z = 10 m is not above lower",
    ),
    ("record.filter", {"lower": ["0 m", "0 m", "90 m"]}, "record.filter: ", "outside the domain, z 0 to 80 m"),
    ("record.filter", {"maximum": {"q": 1}, "minimum": {"q": 2}}, "record.filter.maximum.q: ", "below the minimum, 2"),
    ("record.columns", ["date", "x"], "record.columns: ", "is not of type 'object'"),
    ("record.columns.x", ["x", "y"], "record.columns.x: ", "is not of type 'string'"),
    ("record.columns.x", {"name": "x"}, "record.columns.x: ", "is not of type 'string'"),
    ("record.columns.time", ["a", "b", "c", "d"], "record.columns.time: ", "too long"),
    ("record.columns.magnitud", "M", "record.columns.magnitud: unknown key", "magnitude"),
    ("record.columns", {"time": "date", "x": "x", "y": "y", "mw": "M"}, "record.columns: ", "x, y and z"),
    ("record.columns.mw", "ML", "record.columns.mw: ", "by its name no Mw"),
    ("record.time_zone", "Mars/Olympus", "record.time_zone: ", "no zone"),
    ("record.date_order", "year", "record.date_order: ", "not one of day, month"),
    ("record.conversions", {"ML": {"slope": 1}}, "record.conversions.ML.offset: ", "missing"),
    ("domain", FAR, "frame: the domain lies 5395 km from the frame's origin", "give crs"),
    ("frame", UTM, "frame.crs: the domain lies at latitude -85.5, longitude 56.8, outside", "area of EPSG:32755"),
    ("frame", UTM | {"crs": "nonsense"}, "frame.crs: ", "neither an EPSG code nor WKT"),
    ("record.reader", "seiscomp", "record.reader: ", "not one of"),
    ("excavations.1", IN_DRAWING | {"units": "feet"}, "excavations[1].units: ", "not one of m, cm, mm, km, ft"),
    ("excavations.1", IN_DRAWING | {"offset": ["1 m"]}, "excavations[1].offset: ", "too short"),
    ("excavations.1", IN_DRAWING | {"scale": 0}, "excavations[1].scale: ", "minimum"),
    ("excavations.1", IN_DRAWING | {"height": "3 m"}, "excavations.stope_1.height: ", "not a key of file; its keys"),
    ("excavations.1", IN_DRAWING | {"shape": "box"}, "excavations.stope_1: ", "either a shape or a file"),
    ("excavations.1", IN_DRAWING | UPSIDE_DOWN, "excavations.stope_1.upper: upside down", "not above lower"),
    ("excavations.1", IN_DRAWING | {"shape": "prism"}, "excavations.stope_1: ", "lower and upper, or height"),
    ("excavations.1", IN_DRAWING | {"shape": "prism", "radius": "3 m"}, "excavations.stope_1.radius: ", "not a key"),
    ("excavations.1", BALL | {"radius": "1e300 m"}, "excavations[1].radius: ", "out of range"),
    ("domain.upper", ["80 m", "80 m", "80.00000008 m"], "domain.upper[2]: the side of 80.00000008 m", "not a whole"),
    ("seismic.closeness", 1.5, "seismic.closeness: ", "1.5"),
    ("seismic.closeness", 1, "seismic.closeness: ", "not below the maximum of 1"),
    ("seismic.closeness", 0, "seismic.closeness: ", "not above the minimum of 0"),
    ("seismic.closeness", -0.5, "seismic.closeness: ", "not above the minimum of 0"),
    ("seismic.cluster.clusters", 3, "seismic.cluster.clusters: ", "take kmeans"),
    (
        "seismic.cluster",
        {"min_samples": 2},
        "seismic.cluster: method simultaneous has no clusters",
        "take method families",
    ),
    ("comparison.size_bin", 0, "comparison.size_bin: ", "minimum of 0.01"),
    ("comparison.maximum_events", 1.5, "comparison.maximum_events: ", "not of type 'integer'"),
    ("excavations.0", SHAFT, "excavations.drive.path: stretch 2 is too steep", "cylinder, box or prism"),
    ("excavations.0", LOW_ARCH, "excavations.drive.height: an arched profile", "half its width, 3 m, not 2 m"),
    ("excavations.0", PRISM | {"polygon": BOW_TIE}, "excavations.drive.polygon: crosses itself", "encloses nothing"),
    ("record.units", {"x": "parrot"}, "record.units.x: 'parrot' is not a unit", "like m"),
    ("record.units", {"x": "Pa"}, "record.units.x: 'Pa' is not convertible to m", ""),
    ("record.units", {"moment": "N m"}, "record.units.moment: not a named column", "such are x, y"),
    ("record", {"reader": "elk_creek", "file": "."}, "record.location_error: missing", "record.orientations"),
    ("record", QUAKEML | {"filter": {"maximum": {"rms": 1}}}, "record.filter.maximum: ", "a QuakeML file has no"),
    ("record.orientations", {"start": "2010-09-01"}, "record.orientations.location_error: missing key", ""),
    ("grid", None, "grid: nothing stands below it", "give it keys, or leave it out"),
    ("seismic.cluster", None, "seismic.cluster: nothing stands below it", "leave it out"),
    ("excavations", None, "excavations: nothing stands below it", "give it entries"),
    ("record.rigidity", "33 GPa", "record.rigidity: not used by reader csv", "by elk_creek only; leave it out"),
    ("record", QUAKEML | {"time_zone": "UTC"}, "record.time_zone: not used by reader quakeml", "by csv only"),
    ("record", ELK_CREEK | {"twin": True}, "record.twin: not used by reader elk_creek", "by csv and quakeml only"),
    ("plane", None, "plane: None is not one of none, xz, xy", ""),
    ("excavations.0.radius", None, "excavations[0].radius: None has no unit", "'1 m'"),
    ("ensemble", -1, "ensemble: ", "minimum of 0"),
    ("ensemble", True, "ensemble: ", "not of type 'integer'"),
    ("ensemble", "8", "ensemble: ", "not of type 'integer'"),
    ("solver.scheme", "implicit", "solver.scheme: ", "not one of"),
]


@pytest.mark.parametrize(
    ("key", "value", "begins", "says"), FAULTS, ids=[f"{key}={value}" for key, value, *_ in FAULTS]
)
def test_a_mistake_is_one_line_with_its_key(refuse, key, value, begins, says):
    """File, key, and what was expected; before anything runs."""
    line = refuse(TINY, **{key: value})
    assert line.startswith(begins)
    assert says in line


def test_columns_of_degrees_need_a_frame_with_a_place(refuse, accept):
    """The record's stage could not say where the events are."""
    nowhere = {"frame": {"surface": "1000 m"}}
    assert accept(TINY, **nowhere)
    line = refuse(TINY, **nowhere, **{"record.columns": ON_GLOBE})
    assert line.startswith("record.columns.latitude: the frame has no place on Earth")


def test_the_mines_that_the_faults_start_from_are_good(accept):
    """Otherwise the table above could be right for a wrong reason."""
    assert accept(TINY).dimension == 3
    assert accept(FLAT).dimension == 2


@pytest.mark.parametrize("key", ["name", "frame", "domain", "insitu_stress", "materials"])
def test_a_missing_section_is_named(refuse, key):
    """What no default can know."""
    mine = {name: value for name, value in TINY.items() if name != key}
    assert refuse(mine).split(": ")[:2] in ([key, "missing key"], [f"{key}.lower", "missing key"])


def test_a_missing_solid_is_named_with_the_folder_it_is_looked_for_in(refuse, tmp_path):
    """Paths resolve from the mine file's folder."""
    line = refuse(TINY, **{"excavations.0": {"name": "drive", "step": "history", "file": "solids/drive.stl"}})
    assert line.startswith("excavations.drive.file: ")
    assert "solids/drive.stl is missing" in line
    assert str(tmp_path) in line


def parts(value, path=()):
    """Path of every mapping in a configuration."""
    if isinstance(value, dict):
        yield path
    entries = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, entry in entries:
        yield from parts(entry, (*path, key))


def leaves(value, path=()):
    """Path of every value in a configuration, sections and lists included."""
    if path:
        yield path
    entries = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, entry in entries:
        yield from leaves(entry, (*path, key))


WITHOUT_RECORD = {key: entry for key, entry in TINY.items() if key != "record"}
ODD_NUMBERS = (None, True, 0, -1, 1.5, 10**9, float("nan"), float("inf"))
ODD_TEXTS = "|none|m|1 m|nan MPa|inf m|0 m|1e400 Pa|-5 deg|1 m 2|5 m + 2 s|__import__('os')|history|1 furlong|20 degC"
ODD = st.sampled_from([*ODD_NUMBERS, *ODD_TEXTS.split("|"), [], {}, ["1 m"], {"x": 1}])


@settings(max_examples=400, deadline=None)
@given(st.sampled_from(list(leaves(WITHOUT_RECORD))), ODD)
def test_an_odd_value_is_accepted_or_refused_in_one_line_never_a_traceback(path, value):
    """Whatever stands in a configuration, the user reads at most one line, and no number in use is NaN or infinite."""
    config = copy.deepcopy(WITHOUT_RECORD)
    part = config
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = value
    config = merged(config)
    try:
        mine = load(config, "mine.yaml")
    except InputError:
        return
    json.dumps([mine.grid_slice(), mine.scene_slice(1), mine.event_slice()], allow_nan=False)


FREE_KEYS = {("materials",)}  # the user's own names stand here


@given(st.sampled_from([path for path in parts(merged(TINY)) if path not in FREE_KEYS]))
def test_an_unknown_key_is_refused_anywhere_with_its_path(path):
    """In every mapping of the configuration, however deep."""
    config = merged(TINY)
    part = config
    for key in path:
        part = part[key]
    part["zzz"] = 1
    expected = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in (*path, "zzz")).lstrip(".")
    with pytest.raises(InputError) as refused:
        load(config, "mine.yaml")
    assert f"mine.yaml: {expected}: unknown key" in str(refused.value)


def test_what_yaml_makes_of_dates_and_numbers(accept):
    """An unquoted date is a date to YAML and 1e-5 a text: both are meant."""
    mine = accept(TINY, **{"steps.1.start": datetime.date(2019, 8, 1), "solver.tolerance": "1e-5"})
    assert mine.steps[1]["start"] == "2019-08-01"
    assert mine.values["solver"]["tolerance"] == 1e-5


def test_default_file_holds_no_mine():
    """Snakemake merges deeply: a material or excavation of the default would be in every mine."""
    default = yaml.safe_load(DEFAULT.read_text())
    assert not set(default) & {"materials", "excavations", "rock_bodies", "steps", "record", "loads", "insitu_stress"}


def test_a_strain_out_of_the_plane_is_refused(refuse, accept):
    """Plane strain has none."""
    line = refuse(FLAT, strains=[STRAIN | {"strain": {"zz": -1e-4, "yy": 1e-4}}])
    assert line.startswith("strains.press.strain.yy: ")
    assert "xx, zz, xz" in line
    assert accept(FLAT, strains=[STRAIN]).scene_slice(1)["strains"]


def test_a_strain_with_particles_that_move_is_refused(refuse):
    """Or one that moves no face that is held."""
    moving = {"solver.move": True, "grid.particles_per_cell": 8, "solver.scheme": "explicit"}
    assert refuse(TINY, strains=[STRAIN], **moving).startswith("strains.press: the boundary cannot be strained")
    held = {"domain.boundary": {"x": "roller", "others": "free", "z_lower": "fixed"}}
    line = refuse(TINY, strains=[STRAIN], **held)
    assert line.startswith("strains.press: moves no face")


def test_filled_rock_is_mined_again_and_rock_that_is_gone_is_not(refuse, accept):
    """A later step mines the fill that stands there since an earlier one; without fill nothing is left to mine."""
    dated = {"excavations.2": AGAIN | {"step": "2019-09"}, "steps": [*TINY["steps"], NEXT_STEP]}
    assert accept(TINY, **dated).step_index("2019-09") == 2
    empty = {"excavations.1.fill": "none"}
    assert refuse(TINY, **dated, **empty).startswith("excavations.stope_1_again: the same solid as excavations.stope_1")
    late = {"excavations.1.filled": "2019-09"}
    assert refuse(TINY, **dated, **late).startswith("excavations.stope_1_again: the same solid")


def test_no_stiffness_against_hourglass_patterns_is_needed_with_more_particles(accept):
    """Eight of them hold their cell by themselves."""
    assert accept(TINY, **{"solver.hourglass": 0, "grid.particles_per_cell": 8}).values["solver"]["hourglass"] == 0


def test_short_names_and_whole_numbers_as_decimals_are_good(accept):
    """A name of one letter; 2.0 is an integer to the schema and must be one to the stages."""
    mine = accept(TINY, name="x", **{"grid.levels": 2.0, "excavations.2.name": "s"})
    assert mine.name == "x"
    assert isinstance(mine.values["grid"]["levels"], int)


def test_tension_at_the_surface_alone_is_accepted(accept, refuse):
    """A line fitted through measurements at depth may well leave some tension at the surface; rock under it is not."""
    accept(TINY, **{"insitu_stress.constant.xx": "0.3 MPa"})
    line = refuse(TINY, **{"insitu_stress.constant.xx": "40 MPa"})
    assert line.startswith("insitu_stress: xx is positive, tension, in all of the domain")


def test_particles_that_move_need_explicit_steps(refuse):
    """The other scheme solves for particles that rest."""
    moving = {"solver.move": True, "grid.particles_per_cell": 8, "solver.scheme": "multigrid"}
    assert refuse(TINY, **moving).startswith("solver.move: particles move with scheme explicit only")


def test_an_ensemble_that_would_show_nothing_is_refused(refuse):
    """No catalogue, rock that cannot fail, or all rock of a step taken out at once: the members would tell nothing."""
    undated = {"steps": TINY["steps"][:1], "excavations.1.step": "planned", "ensemble": 2}
    assert refuse(TINY, **undated).startswith("ensemble: no step has dates")
    assert refuse(TINY, ensemble=2, **{"materials.host": FILL}).startswith("ensemble: no rock can fail")
    assert refuse(TINY, ensemble=2, **{"solver.increments": 1}).startswith("ensemble: members differ by the parts")


def test_an_ensemble_leaves_every_slice_of_the_mine_as_it_was(accept):
    """Switched on it re-runs nothing; a member's slices are the mine's and its own number."""
    without, mine = accept(TINY), accept(TINY, ensemble=2)
    assert {path: mine.hashes()[path] for path in without.hashes()} == without.hashes()
    assert set(mine.hashes()) - set(without.hashes()) == {"spread.nc"}
    assert (without.members, mine.members, mine.member(2).members) == (0, 2, 0)
    for step in mine.mined_steps:
        assert "perturbation" not in mine.step_slice(step)
        assert mine.member(2).step_slice(step) == without.step_slice(step) | {"perturbation": 2}
    assert mine.member(2).event_slice() == without.event_slice()


def test_the_draft_of_a_mine_has_no_members(accept):
    """It shows where rock fails; one is enough."""
    draft = draft_of(accept(TINY, ensemble=2, **{"grid.failure_zone": "auto"}))
    assert draft.members == 0
    assert draft.step_slice("draft-0") == draft_of(accept(TINY, **{"grid.failure_zone": "auto"})).step_slice("draft-0")


def test_a_record_without_a_location_error_is_refused(refuse):
    """No comparison of places means anything without it."""
    mine = copy.deepcopy(TINY)
    del mine["record"]["location_error"]
    assert refuse(mine) == "record.location_error: missing key"


def test_a_record_is_read_for_the_modelled_months_unless_told_otherwise(accept):
    """A record of years beside a model of one month would make every ratio of them wrong."""
    assert limits_of(RecordSlice.of(accept(TINY).record_slice())) == {"start": "2019-08-01", "end": "2019-09-01"}
    chosen = limits_of(RecordSlice.of(accept(TINY, **{"record.filter": {"start": "2019-08-10"}}).record_slice()))
    assert chosen == {"start": "2019-08-10", "end": "2019-09-01"}


def test_the_schema_knows_the_columns_that_the_reader_reads(accept):
    """Each as a text, and no other."""
    columns = dict.fromkeys(COLUMN_KEYS, "x")
    assert accept(TINY, **{"record.columns": columns}).values["record"]["columns"] == columns


def test_a_frame_of_map_coordinates_takes_a_domain_of_them(accept):
    """And a projected system without an area of use, as a mine's own grid has none, is taken at its word."""
    far = changed(TINY, domain=FAR, excavations=[], steps=[], frame=UTM)
    assert accept(far).values["frame"]["crs"] == "EPSG:32755"
    own = "+proj=lcc +lat_0=37.8 +lon_0=-105.5 +lat_1=39.75 +lat_2=38.45 +x_0=182926 +y_0=-121923 +datum=NAD83 +units=m"
    assert accept(TINY, frame={"crs": own, "surface": "1000 m"}).values["frame"]["crs"] == own


def test_keys_of_a_file_reach_the_grid_in_metres(accept):
    """Units, scale, offset and the body picked; a prism of a drawing keeps its heights."""
    entry = {"name": "stope_1", "step": "2019-08", "file": "record.csv", "layer": "S1", "units": "ft", "scale": 2.0}
    mine = accept(TINY, **{"excavations.1": entry | {"offset": ["1 km", "0 m", "-5 m"]}})
    made = mine.grid_slice()["excavations"][1]
    assert {key: made[key] for key in ("layer", "units", "scale")} == {"layer": "S1", "units": "ft", "scale": 2.0}
    assert made["offset"] == [1000.0, 0.0, -5.0]
    prism = accept(TINY, **{"excavations.1": entry | {"shape": "prism", "height": "20 m"}})
    assert prism.grid_slice()["excavations"][1]["height"] == 20.0
    assert prism.solids() == mine.solids()
    assert len(mine.solids()) == 1
