"""Speed against accuracy: the front, limits and orders, what settings buy, and a tiny study to its table."""

import json
from dataclasses import asdict, replace

import numpy as np
import pandas as pd
import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st
from running import DEFAULT, STUDIES, run_study, same_costs

from common.costs import Costs
from common.errors import InputError
from verification.studies import Study, load_study
from verification.tradeoff.figure import draw
from verification.tradeoff.knobs import BY_KEY, CHOSEN, changed, label, settings_of
from verification.tradeoff.measures import richardson
from verification.tradeoff.points import Point, Points, measure_study
from verification.tradeoff.runs import SceneRuns, pareto_front
from verification.tradeoff.scenes import apart
from verification.tradeoff.study import PRICE_COLUMNS, STUDY, make_table, percent, price_rows, truth_rows

FEW = st.sampled_from([0.0, 1.0, 2.0, 3.0, np.nan, np.inf])


@given(st.lists(st.tuples(FEW, FEW), max_size=12))
@example([(1.0, 2.0), (1.0, 2.0), (1.0, 1.0)])
def test_the_front_is_what_no_other_point_beats(points):
    """Slow twin: every point against every other."""
    cost, error = np.array(points, float).reshape(-1, 2).T

    def beats(one, other):
        finite = np.isfinite([*points[one], *points[other]]).all()
        no_worse = cost[one] <= cost[other] and error[one] <= error[other]
        return finite and no_worse and points[one] != points[other]

    numbers = range(len(points))
    slow = [bool(np.isfinite(points[i]).all()) and not any(beats(j, i) for j in numbers) for i in numbers]
    assert pareto_front(cost, error).tolist() == slow


@given(st.floats(0.6, 2.9), st.floats(-5.0, 5.0), st.sampled_from([-2.0, 0.3, 7.0]), st.floats(1.3, 3.0))
def test_limit_and_order_of_an_exact_power_law(order, limit, factor, ratio):
    """x = limit + factor h^order on five cells of one ratio, in any order, and with a gap in the series."""
    h = ratio ** np.array([2.0, 0.0, 1.0, -1.0, 3.0])
    for chosen in (slice(None), [0, 1, 4]):
        found = richardson(h[chosen], limit + factor * h[chosen] ** order)
        assert found.order == pytest.approx(order, rel=1e-5)
        assert found.value == pytest.approx(limit, abs=1e-5)


@pytest.mark.parametrize("values", [[1.0, 2.0], [1.0, 2.0, 1.5], [1.0, 1.0, 1.0], [1.0, 1.001, 3.0], [3.0, 2.0, 1.0]])
def test_without_an_order_the_finest_stands_for_the_limit(values):
    """Too few, not monotonic, constant, converging too fast, too slowly."""
    found = richardson([1.0, 2.0, 4.0][: len(values)], values)
    assert found.value == values[0]
    assert np.isnan(found.order)


def made_up(changes: dict[str, dict], limit: tuple = ()) -> SceneRuns:
    """A scene of points: seconds, potency and knobs by variant; six stages, the start of each takes 1 s.

    Its base has a tolerance of 1e-5 and 1e-3 between generations, whatever the defaults are.
    """
    settings = settings_of(load_study(STUDIES / "tradeoff_stope.yaml", DEFAULT).mines["base"].settings)
    settings |= {"tolerance": 1e-5, "cascade": 1e-3}
    points = []
    for name, change in changes.items():
        knobs = {key: value for key, value in change.items() if key in settings}
        measures = {"potency": change["potency"], "events": change.get("events", 9.0), "largest": -1.0, "b": 1.0}
        points.append(
            Point(
                variant=name,
                accuracy=change.get("accuracy", "standard"),
                settings=settings | knobs,
                measures=measures,
                seconds=change["work"] + 6.0,
                stages=6,
                least=1.0,
                wall=90.0,
                compiling=0.0,
                memory=300.0,
                cells=1000,
                failed=10,
            )
        )
    chosen = {"main": "potency", "base": "base", "limit": list(limit)}
    study = Study("made_up", "tradeoff", "Made up", 1, True, {}, chosen, {}, {})
    return SceneRuns(study, Points({}, points))


BASE = {"base": {"work": 10.0, "potency": 1.1}, "again": {"work": 11.0, "potency": 1.1}}


def line_of(scene: SceneRuns, knob: str):
    return next(line for line in scene.lines if line.knob == knob)


def rows_on(scene: SceneRuns, knob: str) -> list[dict]:
    """What each value of a setting buys."""
    return [row for row in price_rows(scene) if row["setting"] == BY_KEY[knob].title]


def test_a_row_says_what_a_value_buys():
    """Twice as fast and 0.4 % off; the error is against the limit of the cells, 1 m3 with order 1."""
    cells = {"c4": (4.0, 1.4), "c2": (2.0, 1.2), "c1": (1.0, 1.1)}
    scene = made_up(
        BASE
        | {name: {"work": 40.0, "cell": cell, "potency": potency} for name, (cell, potency) in cells.items()}
        | {"loose": {"work": 5.0, "tolerance": 1e-3, "potency": 1.1044}},
        limit=list(cells),
    )
    assert scene.truths["potency"].value == pytest.approx(1.0)
    assert scene.truths["potency"].order == pytest.approx(1.0)
    (row,) = rows_on(scene, "tolerance")
    assert (row["from"], row["to"], row["beside"]) == ("1e-05", "1e-03", "")
    assert row["times_as_fast"] == pytest.approx(2.1)
    assert row["change"] == pytest.approx(0.004)
    assert (row["error_before"], row["error"]) == (pytest.approx(0.1), pytest.approx(0.1044))
    assert (row["buys"], row["price"], row["fastest"]) == ("speed, for less than 1 %", "1e-03: 2.1 x, +0.40 %", "yes")
    (truth, *_) = truth_rows(scene)
    assert (truth["measure"], truth["source"]) == ("seismic potency", "limit of ever smaller cells")
    assert (truth["truth"], truth["finest_from_truth"]) == (pytest.approx(1.0), pytest.approx(0.1))
    assert scene.label(scene.points[-1]) == "tolerance 1e-03"
    assert [point in scene.front for point in scene.points] == [True, False, False, False, False, True]


@pytest.mark.parametrize(
    ("work", "potency", "text"),
    [
        (9.6, 1.1, "nothing"),  # repeats differ by a tenth
        (30.0, 1.02, "accuracy"),
        (30.0, 1.1, "nothing"),
        (2.0, 1.4, "speed, for more than 1 %"),
    ],
)
def test_what_is_no_faster_beyond_noise_buys_nothing(work, potency, text):
    run = {"work": work, "cascade": 1e-4, "potency": potency}
    scene = made_up(BASE | {"other": run, "best": {"work": 50.0, "rings": 9, "potency": 1.0}}, limit=["best"])
    assert scene.noise == pytest.approx(1.1)
    (row,) = rows_on(scene, "cascade")
    assert row["buys"] == text
    assert (row["price"] == "no speed") == (work > 9.0)


def test_noise_that_was_not_measured_is_not_told():
    """No run repeats the first scene's base: 4 % are too little to be told all the same."""
    loose = {"loose": {"work": 9.6, "tolerance": 1e-3, "potency": 1.2}}
    alone, repeated = made_up({"base": BASE["base"]} | loose, limit=["loose"]), made_up(BASE | loose, limit=["loose"])
    assert np.isnan(alone.noise)
    assert [row["price"] for row in rows_on(alone, "tolerance")] == ["no speed"]
    table = make_table([alone, repeated])
    assert np.isnan(table.noise[0])
    assert table.noise.dropna().to_list() == [pytest.approx(1.1)]
    assert table[table.noise.notna()].preset.to_list() == ["standard"]


def test_a_repeated_run_takes_the_same_wherever_it_is_told():
    """The median of all runs with its rock, 10 s of the base's: a run that only counts events otherwise is one."""
    scene = made_up(
        BASE
        | {"close": {"work": 8.0, "potency": 1.1, "closeness": 0.9}}
        | {"coarse": {"work": 2.5, "potency": 1.4, "cell": 2.5}}
        | {"loose": {"work": 6.0, "potency": 1.2, "tolerance": 1e-3}}
        | {"loose_again": {"work": 4.0, "potency": 1.2, "tolerance": 1e-3}}
    )
    assert scene.cost(scene.base) == 10.0
    for knob, expected in (("tolerance", 2.0), ("cell", 4.0), ("closeness", 1.0)):
        line = line_of(scene, knob)
        (member,) = (point for point in line.members if point is not line.anchor)
        assert scene.speed(line, member) == expected
    table = make_table([scene])
    shown = [lines[2] for shown in STUDY.shown if shown.file == "table" and (lines := shown.lines(table))]
    assert sum("| times as fast |" in head for head in shown) == 2  # The front is empty: errors have no limit here.
    table = table.set_index("variant")
    assert table.times_as_fast.to_list() == [1.0, 1.0, 1.0, 4.0, 2.0, 2.0]
    assert table.work_s.to_list() == [10.0, 11.0, 8.0, 2.5, 6.0, 4.0]


def test_a_line_may_stand_beside_the_base_and_says_so():
    """Damping is turned in explicit runs alone; events are told where no rock changes."""
    scene = made_up(
        BASE
        | {"explicit": {"work": 30.0, "potency": 1.1, "scheme": "explicit"}}
        | {"damped": {"work": 60.0, "potency": 1.1, "scheme": "explicit", "damping": 0.9}}
        | {"close": {"work": 10.0, "potency": 1.1, "closeness": 0.9, "events": 12.0}}
    )
    (damping,) = rows_on(scene, "damping")
    assert (damping["from"], damping["to"], damping["beside"]) == ("0.7", "0.9", "scheme explicit")
    assert (damping["times_as_fast"], damping["change"], damping["buys"]) == (0.5, 0.0, "nothing")
    (close,) = rows_on(scene, "closeness")
    assert (close["events_before"], close["events"], close["buys"]) == (9.0, 12.0, "another count of events")


def test_a_preset_is_on_the_front_or_beaten_by_a_run_that_is():
    """Draft is the fastest; the base errs by 10 %, and a run that errs by 2 % is quicker; fine has the finest cells.

    Runs of one rock have one place on the front, at their median cost, and do not beat each other.
    """
    scene = made_up(
        BASE
        | {"quickest": {"work": 9.0, "potency": 1.1, "closeness": 0.9, "events": 12.0}}
        | {"draft": {"work": 2.0, "cell": 2.5, "potency": 1.4, "accuracy": "draft"}}
        | {"loose": {"work": 5.0, "tolerance": 1e-3, "potency": 1.02}}
        | {"fine": {"work": 40.0, "cell": 0.625, "potency": 1.01, "accuracy": "fine"}}
        | {"truth": {"work": 90.0, "cell": 0.3, "potency": 1.0}},
        limit=["truth"],
    )
    assert [point.variant for point in scene.presets] == ["draft", "base", "fine"]
    assert scene.cost(scene.base) == scene.cost(scene.points[2]) == 10.0
    assert [point.variant for point in scene.front] == ["draft", "loose", "fine"]
    rows = make_table([scene]).set_index("preset").loc[["draft", "standard", "fine"]]
    assert rows.changes.to_list() == [
        "accuracy draft (finest cell 2.5 m)", "base", "accuracy fine (finest cell 0.625 m)"
    ]  # fmt: skip
    assert rows.main_error.to_list() == pytest.approx([0.4, 0.1, 0.01])
    assert rows.times_as_fast.to_list() == pytest.approx([5.0, 1.0, 0.25])
    assert rows.pareto_front.to_list() == ["yes", "", "yes"]
    assert rows.beaten_by.to_list() == ["", "tolerance 1e-03", ""]


def test_a_preset_that_is_the_truth_has_nothing_to_be_judged_by():
    truth = {"work": 40.0, "cell": 0.625, "potency": 1.01, "accuracy": "fine"}
    scene = made_up(BASE | {"fine": truth}, limit=["fine"])
    row = make_table([scene]).set_index("preset").loc["fine"]
    assert np.isnan(row.main_error)
    assert (row.pareto_front, row.beaten_by) == ("", "")
    assert truth_rows(scene)[0]["source"] == "run fine"


def test_knobs_are_read_from_the_configuration():
    mines = load_study(STUDIES / "tradeoff_stope.yaml", DEFAULT).mines
    base, draft, radius = (settings_of(mines[name].settings) for name in ("base", "draft", "families_radius_12"))
    assert base["increments"] == CHOSEN
    assert changed(draft, base) == ["cell", "tolerance", "cascade", "max_overshoot"]
    assert mines["draft"].settings.accuracy == "draft"
    assert label(radius, changed(radius, base)) == "events are families, cluster radius 1.2 cells"


def test_a_run_whose_limit_is_no_variant_is_refused_in_one_line():
    with pytest.raises(InputError, match="settings: no variant 'finest'; there are base"):
        made_up(BASE, limit=["finest"])


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "+0.00 %"), (0.123, "+12 %"), (-0.00123, "-0.12 %"), (1.0, "+100 %"), (2.0, "+200 %"), (np.nan, "–")],
)
def test_a_change_has_two_digits(value, text):
    assert percent(value) == text


def test_a_study_runs_to_its_tables(tmp_path):
    """The stope on cells of 5 and 2.5 m; costs made up, as nothing was measured."""
    variants = {"base": {"grid": {"levels": 2}}, "fine": {"grid": {"levels": 3}}}
    variants["once"] = {"grid": {"levels": 2}, "solver": {"increments": 1}}
    variants["draft"] = {"grid": {"levels": 3}, "accuracy": "draft"}
    results = run_study("tradeoff_stope", tmp_path, variants)
    results.study.settings["limit"] = ["fine"]
    for number, variant in enumerate(results.variants.values(), start=2):
        variant.costs = same_costs(Costs(9.0, number + 0.5, 0.5, 300.0))
    points = measure_study(results)
    read = Points.read(json.loads(json.dumps(asdict(points))))
    assert json.dumps(asdict(read)) == json.dumps(asdict(points))
    scene = SceneRuns(results.study, read)
    table = make_table([scene]).set_index("variant")
    assert table.loc["base", "potency_m3"] != pytest.approx(table.loc["once", "potency_m3"], rel=1e-3)
    assert table.loc["once", "changes"] == "increments 1"
    assert table.loc["draft", "changes"].startswith("accuracy draft (tolerance ")
    assert table.accuracy.to_list() == ["standard", "standard", "standard", "draft"]
    assert table.processor_s.to_list() == [10.0, 15.0, 20.0, 25.0]  # five stages each, compiling left out
    assert table.wall_s.to_list() == [45.0] * 4
    assert table.compiling_s.to_list() == [2.5] * 4
    assert table.loc["base", "error_potency"] > 0.0
    assert np.isnan(table.loc["fine", "error_potency"])  # it is the truth
    assert table.loc["fine", "apart_m"] == 0.0
    assert table.loc["base", "main_error"] == table.loc["base", "error_potency"]
    assert table.preset.to_list() == ["standard", "", "", "draft"]
    tables = {"table": table, "prices": pd.DataFrame(price_rows(scene)), "truths": pd.DataFrame(truth_rows(scene))}
    assert all(len(shown.lines(tables[shown.file])) > 4 for shown in STUDY.shown)
    assert set(tables["prices"].setting) >= {"finest cell", "increments"}
    assert tuple(tables["prices"]) == PRICE_COLUMNS
    assert tables["truths"].source.iloc[0] == "run fine"
    assert len(draw(scene).axes) == 2
    events = results["fine"].events("mined")
    assert apart(events, results["once"].events("mined")) > 0.0 or events.resolved.sum() == 0


def test_closed_forms_are_met_by_elastic_scenes(tmp_path):
    """Coarse cells: closure within 3 %, stress around within 2 %."""
    for name, grid in (("tradeoff_kirsch", {"finest_cell": "1 m"}), ("tradeoff_cavity", {"finest_cell": "1 m"})):
        results = run_study(name, tmp_path, {"base": {"grid": grid}})
        scene = SceneRuns(results.study, measure_study(results))
        errors = {measure.key: scene.error(scene.base, measure) for measure in scene.measures}
        assert errors["closure"] < 0.03, name
        assert errors["stress"] < 0.02, name


def test_a_run_without_a_closing_line_has_no_time(tmp_path):
    """It is on no front, and no other run's time hangs on it."""
    results = run_study("tradeoff_stope", tmp_path, {"base": {"grid": {"levels": 2}}})
    results.study.settings["limit"] = ["base"]
    results["base"].costs = lambda stage: None if stage == "elastic" else Costs(9.0, 8.0, 0.5, 300.0)
    points = measure_study(results)
    (point,) = points.points
    assert np.isnan([point.seconds, point.wall]).all()
    assert SceneRuns(results.study, points).front == []
    timed = replace(point, variant="timed", seconds=8.0, least=0.5)
    scene = SceneRuns(results.study, replace(points, points=[point, timed]))
    assert np.isnan(scene.work(point))
    assert scene.cost(point) == scene.work(timed) > 0.0
    assert np.isnan(scene.noise)


def test_brittle_scenes_have_the_presets_by_their_key():
    """Draft each, fine where it does not take a quarter of an hour; the base is what the defaults make."""
    fine = set()
    for path in STUDIES.glob("tradeoff_*.yaml"):
        text = yaml.safe_load(path.read_text())
        presets = {change["accuracy"] for change in text["variants"].values() if "accuracy" in change}
        if text["settings"]["main"] in ("potency", "failed_volume"):
            assert "draft" in presets, path
            assert not {"tolerance", "cascade_tolerance", "max_overshoot"} & set(text["scene"].get("solver", {})), path
            fine |= {path.stem} if "fine" in presets else set()
        else:
            assert not presets
    assert "tradeoff_stope" in fine


def test_every_study_of_the_page_names_a_base_that_changes_nothing():
    for path in STUDIES.glob("tradeoff_*.yaml"):
        text = yaml.safe_load(path.read_text())
        assert text["answer"] == "tradeoff"
        assert text["on_request"]
        assert text["threads"] == 1
        assert text["variants"][text["settings"]["base"]] == {}
