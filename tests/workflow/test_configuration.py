"""A mine's configuration: every mistake is one line that names file and key."""

import copy
import datetime
import json
import re

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import BeforeValidator
from tiny_mines import DEFAULT, FILL, FLAT, NEXT_STEP, ROOT, STRAIN, TINY, box, changed, merged

from catalogs.records import record_slice
from catalogs.records.csv_columns import ColumnSettings
from catalogs.records.filters import limits_of
from catalogs.records.times import DATE_PARTS
from common.errors import InputError
from common.setting_types import NAME_PATTERN, Unit
from verification.extremes.bad_input import AGAIN, FAR, FAULTS, UTM
from verification.targets import MEASURING
from workflow.checks import RESERVED
from workflow.configuration import load
from workflow.generate import sections_of
from workflow.mine_settings import MineSettings

DYKE = box("dyke", "history", [0, 0, 0], [10, 80, 80], material="host")
del DYKE["step"]


@pytest.mark.parametrize(
    ("key", "value", "begins", "says"), FAULTS, ids=[f"{key}={value}" for key, value, *_ in FAULTS]
)
def test_a_mistake_is_one_line_with_its_key(refuse, key, value, begins, says):
    """File, key, and what was expected; before anything runs."""
    line = refuse(TINY, **{key: value})
    assert line.startswith(begins)
    assert says in line


def test_no_mine_takes_a_folder_of_results_that_rules_write_to():
    """Whatever stands right below results/ in a rule, but for the mine's own folder."""
    rules = (ROOT / "verification/Snakefile").read_text() + "".join(
        path.read_text() for path in ROOT.glob("*/rules/*.smk")
    )
    assert set(RESERVED) == {*re.findall(r"\bresults/(\w+)", rules), *MEASURING}


def test_columns_of_degrees_need_a_frame_with_a_place(refuse, accept):
    """The record's stage could not say where the events are."""
    nowhere = {"frame": {"surface": "1000 m"}}
    on_globe = {"time": "date", "latitude": "x", "longitude": "y", "depth": "z", "log_potency": "size"}
    assert accept(TINY, **nowhere)
    line = refuse(TINY, **nowhere, **{"record.columns": on_globe})
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


@pytest.mark.parametrize(
    ("values", "line"),
    [
        (
            {"materials.Fill": FILL},
            "materials.Fill: differs in capitals alone from materials.fill; give it another name",
        ),
        (
            {"excavations": [*TINY["excavations"], box("Drive", "planned", [60, 60, 60], [70, 70, 70])]},
            "excavations.Drive: differs in capitals alone from another of the excavations; give it another name",
        ),
        (
            {"rock_bodies": [DYKE, DYKE | {"name": "Dyke"}]},
            "rock_bodies.Dyke: differs in capitals alone from another of the rock_bodies; give it another name",
        ),
        (
            {"strains": [STRAIN, STRAIN | {"name": "PRESS"}]},
            "strains.PRESS: differs in capitals alone from another of the strains; give it another name",
        ),
    ],
)
def test_names_that_differ_in_capitals_alone_are_refused(refuse, values, line):
    """A reader takes them for one, and so do some disks."""
    assert refuse(TINY, **values) == line


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
    json.dumps([mine.grid_slice(), mine.mechanics_slice(1), mine.catalogue_slice()], allow_nan=False)


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
    assert mine.steps[1].start == "2019-08-01"
    assert mine.settings.solver.tolerance == 1e-5


NUMBER_LIKE = ("10E2", "1e3", "007", "12:30", "on", "1_000", "0x10", "-1e-3", "2019-08-01", "1.0")


@pytest.mark.parametrize("text", NUMBER_LIKE)
def test_a_text_that_looks_like_a_number_stays_a_text(accept, text):
    """Where a text is wanted: a layer, a name, a material, a column, a magnitude's type, what a filter looks for."""
    words = {"filter": {"only": {text: [text, "a"]}, "without": {"x": text}}, "conversions": {text: "none"}}
    record = (
        TINY["record"]
        | {"columns": TINY["record"]["columns"] | {"step": text, "time": [text, "t"], "magnitude": "m"}}
        | words
    )
    solid = {"name": "stope_1", "step": "2019-08", "file": "record.csv", "layer": text, "units": "m"}
    mine = accept(TINY, **{"excavations.1": solid, "record": record})
    assert mine.settings.excavations[1].layer == text
    columns = mine.settings.record.columns
    assert (columns.step, columns.time) == (text, (text, "t"))
    assert mine.settings.record.filter.given() == words["filter"]
    assert mine.settings.record.conversions == {text: "none"}
    if re.fullmatch(NAME_PATTERN, text):
        material = {
            "materials": TINY["materials"] | {text: FILL},
            "excavations.1.fill": text,
            "excavations.0.name": text,
        }
        mine = accept(TINY, **material)
        assert (mine.excavations[1].fill, mine.excavations[0].name) == (text, text)


@pytest.mark.parametrize(("text", "number"), [("1e-5", 1e-5), ("1E-2", 1e-2), ("+1e-3", 1e-3), (".1e-1", 1e-2)])
def test_a_number_that_yaml_takes_for_a_text_is_one_where_a_number_is_wanted(accept, refuse, text, number):
    """YAML 1.1 wants a point and a sign: 1.0e-5. 007, on and 12:30 are none, and a decimal comma is none."""
    mine = accept(TINY, **{"solver.tolerance": text, "comparison.seed": "1e3", "record.missing": ["-1e3", text]})
    assert mine.settings.solver.tolerance == number
    assert mine.settings.comparison.seed == 1000
    assert mine.settings.record.missing == (-1000.0, number)
    columns = {key: TINY["record"]["columns"][key] for key in ("time", "x", "y", "z")}
    columns |= {"magnitude": "size", "magnitude_type": "type"}
    converted = {"record.columns": columns, "record.conversions": {"ML": {"slope": "1e0", "offset": "-1e-1"}}}
    assert accept(TINY, **converted).settings.record.conversions["ML"].offset == -0.1
    assert "is not of type 'number'" in refuse(TINY, **{"solver.tolerance": text + "x"})


@pytest.mark.parametrize("value", [7, 1.5, True])
def test_a_number_where_a_text_is_wanted_is_asked_for_in_quotes(refuse, value):
    """YAML reads 007 as 7, 12:30 as 750 and on as true: which was meant nobody can tell."""
    for key in ("record.columns.x", "excavations.1.fill", "excavations.1.step", "record.file"):
        assert "to YAML; put the text in quotes" in refuse(TINY, **{key: value})


def test_every_number_of_the_settings_takes_what_yaml_takes_for_text():
    """No key is forgotten: a number without unit has `common.setting_types.number` before it."""
    told, queue = set(), [MineSettings]
    while queue:
        model = queue.pop()
        told.add(model)
        for name, field in model.model_fields.items():
            queue += [section for section in sections_of(field.annotation) if section not in told | set(queue)]
            number = field.annotation in (int, float) and not any(isinstance(part, Unit) for part in field.metadata)
            assert not number or any(isinstance(part, BeforeValidator) for part in field.metadata), f"{model}.{name}"
    assert len(told) > 20


def test_default_file_holds_no_mine():
    """Snakemake merges deeply: a material or excavation of the default would be in every mine."""
    default = yaml.safe_load(DEFAULT.read_text())
    assert not set(default) & {"materials", "excavations", "rock_bodies", "steps", "record", "loads", "insitu_stress"}


def test_a_strain_out_of_the_plane_is_refused(refuse, accept):
    """Plane strain has none."""
    line = refuse(FLAT, strains=[STRAIN | {"strain": {"zz": -1e-4, "yy": 1e-4}}])
    assert line.startswith("strains.press.strain.yy: ")
    assert "xx, zz, xz" in line
    assert accept(FLAT, strains=[STRAIN]).mechanics_slice(1)["strains"]


def test_a_strain_with_particles_that_move_is_refused(refuse):
    """Or one that moves no face that is held."""
    moving = {"solver.move": True, "solver.scheme": "explicit"}
    moving |= {"grid.particles_per_cell": 8, "grid.cut_cells": "subdivide"}
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


def test_short_names_and_whole_numbers_as_decimals_are_good(accept):
    """A name of one letter; 2.0 is an integer to the schema and must be one to the stages."""
    mine = accept(TINY, name="x", **{"grid.levels": 2.0, "excavations.2.name": "s"})
    assert mine.name == "x"
    assert isinstance(mine.settings.grid.levels, int)


def test_tension_at_the_surface_alone_is_accepted(accept, refuse):
    """A line fitted through measurements at depth may well leave some tension at the surface; rock under it is not."""
    accept(TINY, **{"insitu_stress.constant.xx": "0.3 MPa"})
    line = refuse(TINY, **{"insitu_stress.constant.xx": "40 MPa"})
    assert line.startswith("insitu_stress: xx is positive, tension, in all of the domain")


def test_particles_that_move_need_explicit_steps(refuse):
    """The other scheme solves for particles that rest."""
    moving = {"solver.move": True, "grid.particles_per_cell": 8, "solver.scheme": "multigrid"}
    assert refuse(TINY, **moving).startswith("solver.move: a lone particle must rest where it is; use more")
    moving["grid.cut_cells"] = "subdivide"
    assert refuse(TINY, **moving).startswith("solver.move: particles move with scheme explicit only")


def test_an_ensemble_that_would_show_nothing_is_refused(refuse):
    """No catalogue, rock that cannot fail, or rock that does not vary: the members would tell nothing."""
    undated = {"steps": TINY["steps"][:1], "excavations.1.step": "planned", "ensemble": 2}
    assert refuse(TINY, **undated).startswith("ensemble: no step has dates")
    assert refuse(TINY, ensemble=2, **{"materials.host": FILL}).startswith("ensemble: no rock can fail")
    uniform = {"materials.host.variability": {"share": 0}}
    assert refuse(TINY, ensemble=2, **uniform).startswith("ensemble: members differ by the random strength")


def test_rock_that_loses_strength_varies_over_two_cells_unless_the_file_says_otherwise(accept, refuse):
    def of(**changes):
        return accept(TINY, **changes).settings.materials["host"].variability

    assert (of().share, of().length) == (0.1, 2 * accept(TINY).finest_cell)
    given = of(**{"materials.host.variability": {"length": "30 m"}})
    assert (given.share, given.length) == (0.1, 30.0)
    assert of(**{"materials.host.variability": {"share": 0}}).share == 0
    assert "variability" not in accept(TINY).settings.materials["fill"].given()
    short = refuse(TINY, **{"materials.host.variability": {"length": "1 m"}})
    assert short.startswith("materials.host.variability.length: 1 m is less than two of the finest cells")
    host = accept(TINY).settings.materials["host"]
    plastic = {
        f"materials.host.{name}": {"intact": getattr(host, name).intact, "residual": getattr(host, name).intact}
        for name in ("friction_angle", "cohesion", "tension_cutoff", "dilation_angle")
    }
    plastic = {
        key: {part: f"{value} {'deg' if 'angle' in key else 'Pa'}" for part, value in pair.items()}
        for key, pair in plastic.items()
    }
    assert of(**plastic) is None
    line = refuse(TINY, **plastic, **{"materials.host.variability": {"share": 0.1}})
    assert line.startswith("materials.host.variability: rock that loses no strength when it fails has none")


def test_the_companion_and_a_draft_have_the_rock_of_the_file(accept):
    mine = accept(TINY)
    length = mine.settings.materials["host"].variability.length
    assert mine.coarser().settings.materials["host"].variability.length == length
    assert accept(TINY, accuracy="draft").settings.materials["host"].variability.length == length


def test_an_ensemble_leaves_every_slice_of_the_mine_as_it_was(accept):
    """Switched on it re-runs the comparison only; a member's slices are the mine's and its own number."""
    without, mine = accept(TINY), accept(TINY, ensemble=2)
    assert mine.run_slices() == without.run_slices()
    assert (mine.events_slice(), mine.record_slice()) == (without.events_slice(), without.record_slice())
    assert mine.comparison_slice() == without.comparison_slice() | {"members": 2}
    assert (without.members, mine.members, mine.member(2).members) == (0, 2, 0)
    for step in mine.mined_steps:
        assert "realization" not in mine.step_slice(step)
        assert mine.member(2).step_slice(step) == without.step_slice(step) | {"realization": 2}
    assert mine.member(2).catalogue_slice() == without.catalogue_slice()


def test_a_record_without_a_location_error_is_refused(refuse):
    """No comparison of places means anything without it."""
    mine = copy.deepcopy(TINY)
    del mine["record"]["location_error"]
    assert refuse(mine) == "record.location_error: missing key"


def test_a_record_is_read_for_the_modelled_months_unless_told_otherwise(accept):
    """A record of years beside a model of one month would make every ratio of them wrong."""
    assert limits_of(record_slice(accept(TINY).record_slice())) == {"start": "2019-08-01", "end": "2019-09-01"}
    chosen = limits_of(record_slice(accept(TINY, **{"record.filter": {"start": "2019-08-10"}}).record_slice()))
    assert chosen == {"start": "2019-08-10", "end": "2019-09-01"}


def test_the_schema_knows_the_columns_that_the_reader_reads(accept):
    """Each as a text, and no other."""
    for other in (("time",), DATE_PARTS):  # a time stands in one column, or in those of its parts
        columns = {key: f"column of {key}" for key in ColumnSettings.model_fields if key not in other}
        record = {"record.columns": columns, "record.energy_conversion": {"slope": 1, "offset": 4}}
        assert accept(TINY, **record).settings.record.columns.given() == columns


def test_a_frame_of_map_coordinates_takes_a_domain_of_them(accept):
    """And a projected system without an area of use, as a mine's own grid has none, is taken at its word."""
    far = changed(TINY, domain=FAR, excavations=[], steps=[], frame=UTM)
    assert accept(far).settings.frame.crs == "EPSG:32755"
    own = "+proj=lcc +lat_0=37.8 +lon_0=-105.5 +lat_1=39.75 +lat_2=38.45 +x_0=182926 +y_0=-121923 +datum=NAD83 +units=m"
    assert accept(TINY, frame={"crs": own, "surface": "1000 m"}).settings.frame.crs == own


def test_keys_of_a_file_reach_the_grid_in_metres(accept):
    """Units, scale, offset and the body picked; a prism of a drawing keeps its heights."""
    entry = {"name": "stope_1", "step": "2019-08", "file": "record.csv", "layer": "S1", "units": "ft", "scale": 2.0}
    mine = accept(TINY, **{"excavations.1": entry | {"offset": ["1 km", "0 m", "-5 m"]}})
    made = mine.grid_slice()["excavations"][1]
    assert {key: made[key] for key in ("layer", "units", "scale")} == {"layer": "S1", "units": "ft", "scale": 2.0}
    assert made["offset"] == [1000.0, 0.0, -5.0]
    prism = accept(TINY, **{"excavations.1": entry | {"shape": "prism", "height": "20 m"}})
    assert prism.grid_slice()["excavations"][1]["height"] == 20.0


def test_the_length_of_links_follows_the_cells_of_the_file(accept, refuse):
    """4 m, within two to eight of the finest cells; the same on the cells of a draft and of the companion."""

    def length(**changes):
        mine = accept(TINY, **changes)
        return mine.finest_cell, mine.settings.seismic.link_length, mine.coarser().settings.seismic.link_length

    cell, own, coarse = length()
    assert own == coarse == max(4.0, 2.0 * cell)
    assert length(accuracy="draft")[1] == own
    given = f"{3 * cell:g} m"
    assert length(**{"seismic.link_length": given})[1] == pytest.approx(3 * cell)
    line = refuse(TINY, **{"seismic.link_length": f"{1.9 * cell:g} m"})
    assert line.startswith(f"seismic.link_length: {1.9 * cell:g} m is less than two of the finest cells ({cell:g} m)")
    families = {"seismic.method": "families", "seismic.link_length": given}
    assert "method families has cluster.radius_cells" in refuse(TINY, **families)
    assert accept(TINY, **{"seismic.method": "families"}).settings.seismic.link_length is None
