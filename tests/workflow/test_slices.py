"""What a mine's configuration hands to each stage: SI values, and only those that the stage needs."""

import copy
import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tiny_mines import DIRECTED, NEXT_STEP, STRAIN, TINY, box, merged

from common.errors import InputError
from mpm_core.scene.scene import parse_scene
from mpm_core.scene.step_settings import read_scene_attribute, scene_attribute, settings_up_to
from workflow.configuration import load


def test_values_are_si(accept):
    """Metres, pascals; angles stay degrees."""
    mine = accept(TINY, **{"materials.host.friction_angle.intact": "0.5 rad", "frame.surface": "1 km"})
    slice_ = mine.mechanics_slice(0)
    assert slice_["materials"]["host"]["youngs_modulus"] == 57e9
    assert slice_["materials"]["host"]["friction_angle"]["intact"] == pytest.approx(28.6479, abs=1e-4)
    assert slice_["surface"] == 1000.0
    assert slice_["insitu_stress"]["gradient"][1] == pytest.approx(-36300)
    assert mine.grid_slice()["domain"]["upper"] == [80, 80, 80]


def merged_slices(mine) -> list[dict]:
    """Settings up to each step, as its stage has them: the job's file and the attribute of the state before, JSON."""
    before = mine.mechanics_slice(0)
    found = []
    for step in mine.mined_steps:
        state = json.loads(json.dumps(scene_attribute(before)))
        before = settings_up_to(read_scene_attribute(state), json.loads(json.dumps(mine.step_slice(step))))
        found.append(before)
    return found


def test_a_planned_stope_looks_like_one_dated_later(accept):
    """Giving stope_2 its month, and a new fill, changes no slice that stands."""
    before = accept(TINY)
    dated = {"excavations.2.step": "2019-09", "excavations.2.fill": "paste", "steps": [*TINY["steps"], NEXT_STEP]}
    after = accept(TINY, **dated, **{"materials.paste": {**TINY["materials"]["fill"], "youngs_modulus": "2 GPa"}})
    assert after.grid_slice() == before.grid_slice()
    assert after.mechanics_slice(0) == before.mechanics_slice(0)
    assert [after.step_slice(step) for step in before.mined_steps] == [
        before.step_slice(step) for step in before.mined_steps
    ]
    month = after.step_slice("2019-09")
    assert month["excavations"] == [{"number": 2, "mined": 2, "fill": "paste", "filled": 2}]
    assert set(month["materials"]) == {"host", "paste"}
    stope = {"name": "stope_2", "mined": 2, "fill": "paste", "filled": 2}
    assert merged_slices(after)[2]["excavations"][2] == stope


def test_pressure_on_a_wall_stands_in_the_slices_of_the_steps_that_change_it(accept):
    """One value from the step that mines; a mapping by step; none before, and none where none is given."""
    one = accept(TINY, **{"excavations.0.pressure": "5 MPa"})
    assert one.mechanics_slice(0)["excavations"][0]["pressure"] == [[0, 5e6]]
    assert [entry["number"] for entry in one.step_slice("2019-08")["excavations"]] == [1]
    assert "pressure" not in one.step_slice("2019-08")["excavations"][0]
    by_step = accept(TINY, **{"excavations.0.pressure": {"2019-08": "0 MPa", "history": "30 bar"}})
    assert by_step.mechanics_slice(0)["excavations"][0]["pressure"] == [[0, 3e6]]
    assert by_step.step_slice("2019-08")["excavations"][0] == {"number": 0, "pressure": [[1, 0.0]]}
    assert merged_slices(by_step)[1]["excavations"][0]["pressure"] == [[0, 3e6], [1, 0.0]]
    late = accept(TINY, **{"excavations.0.step": "2019-08", "excavations.0.pressure": "5 MPa"})
    assert "pressure" not in late.mechanics_slice(0)["excavations"][0]
    assert late.grid_slice() == accept(TINY, **{"excavations.0.step": "2019-08"}).grid_slice()
    planned = accept(TINY, **{"excavations.2.pressure": "5 MPa", "excavations.2.fill": "none"})
    assert "pressure" not in merged_slices(planned)[1]["excavations"][2]


@settings(deadline=None)
@given(
    st.lists(st.tuples(*[st.integers(0, 4)] * 2, st.booleans(), st.sets(st.integers(0, 4))), min_size=1, max_size=4),
    st.lists(st.integers(0, 3), max_size=3),
    st.lists(st.integers(0, 3), max_size=3),
)
def test_settings_merged_step_by_step_are_those_of_the_whole(entries, loads, strains):
    """Slow twin: the settings up to each step from all that the mine file lists. Steps are 0 to 3; 4 is planned."""
    steps = [f"2019-{month:02d}" for month in range(1, 5)]
    dated = [{"name": name, "start": f"{name}-01", "end": f"{name}-20"} for name in steps]
    names, excavations = [*steps, "planned"], []
    for number, (mined, filled, is_filled, pressed) in enumerate(entries):
        low = [10 + 15 * number, 30, 30]
        entry = box(f"stope_{number}", names[mined], low, [low[0] + 10, 40, 40], fill="none")
        if is_filled and mined < 4:
            entry |= {"fill": "fill", "filled": names[max(mined, filled)]}
        elif pressed := sorted(step for step in pressed if mined <= step < 4):
            entry |= {"pressure": {names[step]: f"{step} MPa" for step in pressed}}
        excavations.append(entry)
    values = {key: value for key, value in TINY.items() if key != "record"} | {
        "steps": dated,
        "excavations": excavations,
        "loads": [DIRECTED | {"name": f"load_{n}", "step": steps[step]} for n, step in enumerate(loads)],
        "strains": [STRAIN | {"name": f"strain_{n}", "step": steps[step]} for n, step in enumerate(strains)],
    }
    mine = load(merged(values), "mine.yaml")
    found, whole = merged_slices(mine), [mine.mechanics_slice(number) for number in range(len(mine.steps))]
    assert found == json.loads(json.dumps(whole))
    assert [list(one["materials"]) for one in found] == [list(one["materials"]) for one in whole]
    assert [parse_scene(one).excavations for one in found] == [parse_scene(one).excavations for one in whole]


def test_settings_of_a_step_change_nothing_that_they_are_merged_with(accept):
    """The settings of a run in one process are used again for the next step."""
    mine = accept(TINY, **{"excavations.0.pressure": {"2019-08": "0 MPa", "history": "30 bar"}})
    before, step = mine.mechanics_slice(0), mine.step_slice("2019-08")
    kept = copy.deepcopy((before, step))
    settings_up_to(before, step)
    assert (before, step) == kept


def test_a_step_after_another_state_is_refused(accept):
    """One that does not follow, a state without its settings, and settings of another stage."""
    mine = accept(TINY, steps=[*TINY["steps"], NEXT_STEP])
    elastic = mine.mechanics_slice(0)
    with pytest.raises(InputError, match=r"steps\.2019-09: does not follow .*, which has 1 steps, not 2; run the pipe"):
        settings_up_to(elastic, mine.step_slice("2019-09"))
    with pytest.raises(InputError, match="made by an earlier version"):
        read_scene_attribute({})
    with pytest.raises(InputError, match="not the settings of stage step"):
        settings_up_to(elastic, elastic)


@pytest.mark.parametrize(
    ("key", "value", "same"),
    [
        ("seismic.closeness", 0.7, {"grid_slice", "mechanics_slice", "record_slice"}),
        ("solver.tolerance", 1e-4, {"grid_slice", "catalogue_slice", "record_slice"}),
        ("grid.levels", 3, {"record_slice"}),
        ("record.location_error", "9 m", {"grid_slice", "mechanics_slice", "catalogue_slice"}),
        ("comparison.seed", 2, {"grid_slice", "mechanics_slice", "catalogue_slice", "record_slice"}),
    ],
)
def test_a_slice_holds_only_what_its_stage_needs(accept, key, value, same):
    """A changed value re-runs what depends on it and nothing else."""
    before, after = accept(TINY), accept(TINY, **{key: value})
    slices = {name: getattr(before, name) for name in ("grid_slice", "catalogue_slice", "record_slice")}
    slices["mechanics_slice"] = lambda: before.mechanics_slice(1)
    others = {name: getattr(after, name) for name in ("grid_slice", "catalogue_slice", "record_slice")}
    others["mechanics_slice"] = lambda: after.mechanics_slice(1)
    assert {name for name in slices if slices[name]() == others[name]()} == same


def test_every_setting_of_the_comparison_can_be_set(accept):
    """Its slice holds all of them, those of the default as well."""
    chosen = {"resamplings": 199, "seed": 3}
    slice_ = accept(TINY, **{f"comparison.{key}": value for key, value in chosen.items()}).comparison_slice()
    steps = [{"name": "2019-08", "start": "2019-08-01", "end": "2019-09-01"}]
    assert slice_ == {"steps": steps} | chosen


def test_dates_reach_the_events_of_their_step_alone(accept):
    """And what is compared with them. No slice of the mechanics has them, nor have the events of another step."""
    before, after = accept(TINY), accept(TINY, **{"steps.1.end": "2019-09-15"})
    stages = ("grid", "elastic", "steps/history", "steps/2019-08")
    assert all(before.slice_of(stage) == after.slice_of(stage) for stage in stages)
    assert before.step_events_slice("history") == after.step_events_slice("history")
    assert before.comparison_slice() != after.comparison_slice()
    assert after.step_events_slice("2019-08")["end"] == "2019-09-15"
    assert after.step_events_slice("history")["start"] == ""


def test_undated_scene_gets_a_history_of_its_own(accept):
    """Dated steps alone: what is mined before them is nothing, and the first step is still the history."""
    mine = accept(TINY, **{"steps": TINY["steps"][1:], "excavations.0.step": "2019-08"})
    assert mine.mined_steps == ["history", "2019-08"]
    assert mine.dated_steps == ["2019-08"]
    assert mine.previous("2019-08") == "history"
    assert mine.previous("history") == ""


def test_boundary_by_axis_by_face_and_for_the_others(accept):
    """`x: roller` is both faces; what is not named is `others`, or fixed."""
    faces = accept(TINY, **{"domain.boundary": {"x": "roller", "z_upper": "free", "others": "fixed"}}).boundary()
    assert faces == {
        **dict.fromkeys(("x_lower", "x_upper"), "roller"),
        **dict.fromkeys(("y_lower", "y_upper", "z_lower"), "fixed"),
        "z_upper": "free",
    }


def test_checking_changes_nothing_of_what_was_given(accept):
    """Snakemake's own config object stays as it was read: the report shows it."""
    config = merged(TINY)
    kept = copy.deepcopy(config)
    with pytest.raises(InputError):
        load(config, "mine.yaml")  # its record is not there
    assert config == kept


def test_a_step_that_mines_nothing_is_legal(accept):
    """Time passes: no excavation need name a step."""
    assert accept(TINY, **{"excavations": [box("drive", "history", [20, 30, 40], [60, 40, 50])]}).mined_steps


def test_loads_and_strains_reach_the_slices_of_their_steps_and_later_ones_alone(accept):
    """Directed force in newton and metres, strain by Voigt order; a slice without strains is what it was before."""
    mine = accept(TINY, loads=[DIRECTED], strains=[STRAIN])
    early, late = mine.mechanics_slice(0), mine.mechanics_slice(1)
    assert early["loads"] == []
    assert "strains" not in early
    assert late["strains"] == [{"name": "press", "since": 1, "strain": [0.0, 0.0, -1e-4, 0.0, 0.0, 0.0]}]
    load = late["loads"][0]
    assert (load["force"], load["toward"]) == (1e6, [40.0, 40.0, 40.0])
    assert set(load["shape"]) == {"shape", "lower", "upper"}
    assert accept(TINY).mechanics_slice(1) == {key: late[key] for key in late if key != "strains"} | {"loads": []}


def test_the_outside_of_a_shape_is_another_grid(accept):
    """`outside: false` is the same as not saying it."""
    plain, inner = accept(TINY), accept(TINY, **{"excavations.0.outside": False})
    outer = accept(TINY, **{"excavations.0.outside": True})
    assert inner.grid_slice() == plain.grid_slice()
    assert outer.grid_slice()["excavations"][0] == plain.grid_slice()["excavations"][0] | {"outside": True}
