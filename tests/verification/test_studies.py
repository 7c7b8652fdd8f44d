"""Study files: variants over a base scene over the default, and one line for each mistake."""

import copy

import pytest
import yaml
from running import DEFAULT, STUDIES

from common.costs import Costs
from common.errors import InputError
from verification.results import read_results
from verification.rows import KnownMiss
from verification.studies import FOLDER, load_study, merge
from workflow.strict_yaml import read_yaml

HOLE = {
    "answer": "kirsch",
    "title": "A hole",
    "about": "One\n  line.",
    "allowed": {"stress": 0.1},
    "scene": {
        "plane": "xy",
        "frame": {"surface": "0 m"},
        "domain": {"lower": ["-40 m", "-40 m"], "upper": ["40 m", "40 m"]},
        "grid": {"coarse_cell": "8 m", "levels": 3},
        "insitu_stress": {"constant": {"xx": "-30 MPa", "yy": "-30 MPa"}},
        "materials": {
            "host": {"model": "elastic", "youngs_modulus": "7 GPa", "poisson_ratio": 0.2, "density": "2700 kg/m^3"}
        },
        "excavations": [
            {"name": "hole", "step": "history", "shape": "circle", "center": ["0 m", "0 m"], "radius": "9 m"}
        ],
    },
    "variants": {"plain": None, "coarse": {"grid": {"levels": 1}}},
}


def write(folder, study: dict):
    path = folder / "hole.yaml"
    path.write_text(yaml.safe_dump(study))
    return path


def test_a_variant_changes_the_scene_and_nothing_else(tmp_path):
    study = load_study(write(tmp_path, HOLE), DEFAULT)
    plain, coarse = (study.mines[name].settings.given() for name in ("plain", "coarse"))
    assert (plain["name"], coarse["name"]) == ("hole-plain", "hole-coarse")
    assert coarse["grid"] == plain["grid"] | {"levels": 1}
    assert (plain["seismic"]["link_length"], coarse["seismic"]["link_length"]) == (4.0, 16.0)  # 2 and 8 m cells
    assert coarse | {key: plain[key] for key in ("grid", "name", "seismic")} == plain
    assert plain["solver"]["damping"] == DEFAULT["solver"]["damping"]
    assert (study.threads, study.events) == (64, False)


def test_known_misses_are_listed_by_row_with_their_cause(tmp_path):
    entry = {"cause": "The hole\n is square.", "rows": {"closure, m": 0.2, "stress, Pa": 3}}
    study = load_study(write(tmp_path, HOLE | {"known_misses": [entry]}), DEFAULT)
    assert study.known_misses == {
        "closure, m": KnownMiss("The hole is square.", 0.2),
        "stress, Pa": KnownMiss("The hole is square.", 3.0),
    }


def test_merging_replaces_lists_and_leaves_both_sides_alone():
    base, change = {"a": {"b": [1, 2], "c": 3}}, {"a": {"b": [4]}}
    before = copy.deepcopy((base, change))
    assert merge(base, change) == {"a": {"b": [4], "c": 3}}
    assert (base, change) == before


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"answr": "kirsch"}, "answr: unknown key"),
        ({"known_misses": [{"rows": {"closure, m": 0.2}}]}, "known_misses: entry 1: takes a cause and rows"),
        (
            {"known_misses": [{"cause": "x", "rows": {"closure, m": "much"}}]},
            "known_misses: 'closure, m' takes a number",
        ),
        ({"known_misses": [{"cause": "x", "rows": {"a": 1}}, {"cause": "y", "rows": {"a": 2}}]}, "'a' is listed twice"),
        ({"variants": {}}, "a scene needs variants"),
        ({"variants": {"x y": None}}, "variants.x y: use letters, digits"),
        ({"variants": {"bad": {"grid": {"level": 2}}}}, "variants.bad: grid.level: unknown key"),
        ({"variants": {"bad": {"grid": {"coarse_cell": "8 s"}}}}, "variants.bad: grid.coarse_cell"),
    ],
)
def test_a_mistake_is_one_line_with_file_and_key(tmp_path, change, message):
    with pytest.raises(InputError) as error:
        load_study(write(tmp_path, HOLE | change), DEFAULT)
    assert "hole.yaml: " in str(error.value)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_a_study_that_is_not_there_is_one_line(tmp_path):
    with pytest.raises(InputError, match="not readable"):
        load_study(tmp_path / "none.yaml", DEFAULT)


def test_a_key_that_stands_twice_is_refused_as_in_a_mines_file(tmp_path):
    """YAML would take the second one in silence: a bound that is listed twice, say."""
    path = write(tmp_path, HOLE)
    path.write_text(path.read_text() + "title: Another hole\n")
    with pytest.raises(InputError, match=r"hole\.yaml: line \d+: title: this key stands twice"):
        load_study(path, DEFAULT)


def test_merging_replaces_what_is_no_mapping_by_a_mapping_and_the_other_way_round():
    assert merge({"a": 1, "b": {"c": 2}, "d": None}, {"a": {"x": 1}, "b": None, "d": {"y": {}}}) == {
        "a": {"x": 1},
        "b": None,
        "d": {"y": {}},
    }


@pytest.mark.parametrize("path", sorted(STUDIES.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_study_of_the_project_is_well_formed(path):
    """That of Elk Creek where its recorded data are."""
    try:
        study = load_study(path, DEFAULT)
    except InputError as error:
        if path.stem == "elk_creek" and "no Elk Creek data here" in str(error):
            pytest.skip("no Elk Creek data")
        raise
    assert study.title
    assert read_yaml(path)["about"]  # for whoever opens the file


def test_a_variants_costs_stand_in_the_logs_of_its_stages(tmp_path):
    """Where the rules leave them, by variant and stage; nothing is known of a stage without one."""
    path = tmp_path / "hole.yaml"
    path.write_text(yaml.safe_dump(HOLE))
    took = Costs(12.0, 20.0, 5.0, 345.0)
    log = tmp_path / "logs" / "coarse" / "steps" / "mined.log"
    log.parent.mkdir(parents=True)
    log.write_text(f"INFO {took.closing_line('step a.nc')}\n")
    coarse = read_results(load_study(path, DEFAULT), tmp_path / "results", tmp_path / "logs")["coarse"]
    assert coarse.costs("steps/mined") == took
    assert (coarse.seconds("steps/mined"), coarse.peak_memory("steps/mined")) == (12.0, 345.0)
    assert coarse.processor_time("steps/mined") == 15.0
    assert coarse.seconds("grid") is coarse.processor_time("grid") is None


def test_in_a_specimen_links_are_eight_cells_long():
    """The default of 4 m would join all rock of a disc of the laboratory."""
    for mine in load_study(FOLDER / "brazilian_disc.yaml").mines.values():
        assert mine.finest_cell < 0.01
        assert mine.settings.seismic.link_length == pytest.approx(8.0 * mine.finest_cell)
