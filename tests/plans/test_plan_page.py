"""The page of the plans: its sentences, its tables, and what it says is missing."""

import re

import numpy as np
import pandas as pd
import pytest
from plan_fixtures import (
    HAZARD,
    MINE,
    OPENINGS,
    STEPS,
    comparison_of,
    drawn_ensemble,
    drawn_run,
    made_up_grid,
    made_up_record,
    write_run,
)
from plan_fixtures import outcome_slice as slice_of
from test_opening_depths import openings_of

from catalogs.report.text import DASH, DOWN, UP, number
from catalogs.settings import DatedStep
from common.errors import InputError
from plans.comparisons import Comparisons
from plans.differences import MIN_RUNS
from plans.layout import PlanSummary
from plans.outcome import make_outcome
from plans.overview import overview
from plans.page import write_report
from plans.sentences import chance_with_interval, interval_contents, law_texts, missing, verdict
from plans.settings import PlansReportSlice
from plans.tables import exposed_rows, forecast_rows, matrix, opening_rows, plan_rows, step_rows

GRID = made_up_grid()
SETTINGS = PlansReportSlice.of({"mine": MINE, "hazard": HAZARD})
OTHER_ORDER = [
    {"name": "drive"},
    {"name": "stope_1", "step": "2019-09"},
    {"name": "stope_2", "step": "2019-08"},
]
LONGER = (*STEPS, DatedStep(name="2019-10", start="2019-10-01", end="2019-11-01"))


@pytest.fixture(scope="module")
def plans(tmp_path_factory):
    """The plan of the mine file, another order with three times the events, and one that goes on for a month."""
    folder = tmp_path_factory.mktemp("plans")
    own = [*drawn_ensemble(folder / "own", 1), drawn_run(folder / "coarse", "coarse", 2)]
    more = [*drawn_ensemble(folder / "more", 3, (130, 80)), drawn_run(folder / "c", "coarse", 4, (130, 80))]
    last = [
        *drawn_ensemble(folder / "last", 5, (30,), steps=LONGER[2:]),
        drawn_run(folder / "last_coarse", "coarse", 5, (30,), steps=LONGER[2:]),
    ]
    longer = [
        {"kind": one["kind"], **{key: [*one[key], *end[key]] for key in ("events", "states")}}
        for one, end in zip(own, last, strict=True)
    ]
    recorded = {"recorded_steps": [step.given() for step in STEPS], "recorded_runs": own[:5]}
    steps = [step.given() for step in LONGER]
    given = (
        slice_of(own, "mine_file", **recorded),
        slice_of(more, "other_order", openings=OTHER_ORDER, **recorded),
        slice_of(longer, "longer", steps=steps, **recorded),
    )
    record = made_up_record(50, 7, end="2019-10-01")
    return [PlanSummary(make_outcome(one, GRID, record, comparison_of())) for one in given]


def test_the_first_sentences_compare_each_plan_with_the_first(plans):
    said = verdict(Comparisons(plans), SETTINGS.hazard)
    assert re.match(
        r"other_order releases [\d.]+ times the potency of mine_file \(95 % interval [\d.]+ to [\d.]+\): ", said[0]
    )
    assert re.search(
        r"It makes [\d.]+ times the events \(95 % interval .*\): a difference larger than chance explains\.", said[0]
    )
    assert re.match(
        r"longer mines as mine_file does, and goes on with 2019-10, which adds [\d.]+ events and [\d.]+ m³ of "
        r"potency to [\d.]+ events and [\d.]+ m³ of the steps before\.",
        said[1],
    )
    assert len(said) == 2  # the table beside them has the chances
    assert verdict(Comparisons(plans[:1]), SETTINGS.hazard)[0].startswith("mine_file makes ")


def test_the_first_screen_agrees_with_the_tables_below_it(plans):
    """Number, potency and volume of each plan, its chance, and the factor that the record has beside the runs."""
    shown = overview(Comparisons(plans), SETTINGS.hazard, {"longer": "One month more"})
    assert [row["title"] for row in shown["rows"]] == ["", "", "One month more"]
    for row, table, plan in zip(shown["rows"], plan_rows(Comparisons(plans)), plans, strict=True):
        assert (row["number"], row["potency"]) == (table["number"], table["potency"])
        assert row["mined"].startswith(f"{table['mined']} m³ in ")
        assert row["chance"].startswith(matrix(plan, SETTINGS.hazard, Comparisons(plans))[0]["cells"][0]["yearly"])
        by_opening = {name: plan.means(plan.steps, name).potency for name in plan.openings}
        assert row["where"].split(" (")[0] == max(by_opening, key=lambda name: by_opening[name])
    assert shown["chance"] == "chance per year: damaging (Mw 0.6 or more) within 10 m"
    bases = [row["chance_basis"] for row in shown["rows"]]
    assert bases[0] == "at the rate of 2019-08 and 2019-09"
    verdicts = r"\d\.\d+ \([\d.]+ to [\d.]+\) times that of mine_file: (larger than|difference within) chance.*"
    assert re.fullmatch(rf"at the rate of 2019-10; {verdicts}", bases[2])
    assert [row["compared"].split(":")[-1].strip() for row in shown["rows"]][::2] == ["–", "the same, and 2019-10"]
    low, middle, high = plans[0].outcome.attrs["record_factor"]
    assert low < middle < high
    said = re.search(r"in 2019-08 and 2019-09, ([\d.]+) \(([\d.]+) to ([\d.]+)\) events", shown["record"])
    assert said is not None
    assert float(said[1]) == pytest.approx(middle, rel=0.05)
    assert (said[2], said[3]) == (number(low, 2, DOWN), number(high, 2, UP))


def test_the_first_screen_states_no_chance_of_few_runs_and_no_factor_without_a_record(tmp_path):
    runs = [drawn_run(tmp_path / "own", "own", 1)]
    alone = [PlanSummary(make_outcome(slice_of(runs, "mine_file"), GRID, None, None))]
    shown = overview(Comparisons(alone), SETTINGS.hazard, {})
    assert shown["chance"] == shown["record"] == ""
    assert shown["rows"][0]["compared"] == "–"


def test_a_plan_with_the_same_runs_is_said_to_be_the_same(plans):
    assert (
        verdict(Comparisons([plans[0], plans[0]]), SETTINGS.hazard)[0] == "mine_file and mine_file are the same runs."
    )


def test_what_is_missing_names_its_key(plans, tmp_path):
    assert [
        key
        for one in missing(Comparisons(plans), SETTINGS.hazard)
        for key in ("hazard.runs", "hazard.rock")
        if key in one
    ] == ["hazard.rock"]
    assert interval_contents(Comparisons(plans)) == (
        "Intervals of ratios contain chance and what the cells change. Intervals of chances contain chance, by how "
        "much the record differs from the model and what is not known of the law of sizes."
    )
    kinds = ["own", "member", "draw", "draw", "draw"]
    runs = [drawn_run(tmp_path / str(seed), kind, seed) for seed, kind in enumerate(kinds)]
    plain = make_outcome(slice_of(runs, hazard={}), GRID)
    found = missing(Comparisons([PlanSummary(plain)]), PlansReportSlice.of({"mine": MINE}).hazard)
    assert [one for one in found if "Each plan has 2 runs, too few to say" in one and "Set hazard.runs to 5" in one]
    assert [one for one in found if "grid_convergence" in one]
    assert [one for one in found if "hazard.magnitudes" in one]
    assert not [one for one in found if "hazard.rock" in one]


def test_tables_hold_the_numbers_of_the_outcomes(plans):
    rows = plan_rows(Comparisons(plans))
    assert [row["plan"] for row in rows] == ["mine_file", "other_order", "longer"]
    assert rows[0]["potency_ratio"] == "–"
    assert rows[1]["number_ratio"] != "–"
    assert rows[2]["verdict"] == "goes on with 2019-10"
    own = plans[0].outcome
    mean = own["number"].sel(opening="any").isel(run=slice(5)).sum("step").mean()
    assert float(rows[0]["number"]) == pytest.approx(float(mean), abs=0.051)
    assert rows[0]["mined"].replace("\u202f", "") == f"{2 * 12 * 20 * 30}"

    steps = step_rows(Comparisons(plans), SETTINGS.hazard)
    assert [(row["step"], row["plan"]) for row in steps] == [
        ("2019-08", "mine_file"), ("", "other_order"), ("", "longer"),
        ("2019-09", "mine_file"), ("", "other_order"), ("", "longer"),
        ("2019-10", "longer"),
    ]  # fmt: skip
    assert [row["mines"] for row in steps[:3]] == ["stope_1", "stope_2", "stope_1"]
    assert steps[2]["potency_ratio"] == "the same runs"
    assert all(re.match(r"(up to |more than )?[\d.]+ %", row["chance"]) for row in steps)
    assert {row["chance"] for row in step_rows(Comparisons(plans), PlansReportSlice.of({"mine": MINE}).hazard)} == {""}
    openings = opening_rows(Comparisons(plans))
    assert {(row["plan"], row["step"]) for row in openings if row["plan"] == "other_order"} <= {
        ("other_order", "2019-08"), ("other_order", "2019-09"), ("other_order", "before"),
    }  # fmt: skip
    assert len([row for row in openings if row["opening"]]) == len(OPENINGS)


def test_the_risk_matrix_has_the_largest_class_first(plans):
    rows = matrix(plans[0], SETTINGS.hazard, Comparisons(plans))
    assert [row["size"] for row in rows] == ["damaging", "felt"]
    chance, interval = plans[0].chance("any", 30.0, "damaging")
    assert rows[0]["cells"][1]["yearly"] == chance_with_interval(chance, interval)
    assert rows[0]["cells"][1]["likelihood"] == SETTINGS.hazard.likelihood(chance)
    assert exposed_rows(plans, SETTINGS.hazard)[0]["cells"]


def test_steps_ahead_are_forecast(plans):
    rows = forecast_rows(plans)
    assert [(row["plan"], row["step"]) for row in rows] == [("longer", "2019-10")]
    assert re.fullmatch(r"\d+ \(\d+ to \d+\)", rows[0]["number"])
    low, high = map(int, re.search(r"\((\d+) to (\d+)\)", rows[0]["number"]).groups())
    draws = plans[2].outcome["forecast_number"].sel(step="2019-10").values
    np.testing.assert_allclose([low, high], np.quantile(draws, [0.025, 0.975], method="nearest"))
    few = PlanSummary(plans[2].outcome.assign_attrs(runs=MIN_RUNS - 1))  # too few to say how another run would differ
    (row,) = forecast_rows([few])
    assert row["number"] == f"{np.median(draws):.0f}"
    assert row["potency"] == row["largest"] == DASH


def test_the_page_needs_nothing_else_and_the_table_holds_all(plans, tmp_path):
    outcomes = [plan.outcome for plan in plans]
    page, table = tmp_path / "report.html", tmp_path / "plans.csv"
    depths = [np.linspace(2.0, 3.0, 5), np.linspace(6.0, 7.0, 5), np.linspace(2.0, 3.0, 5)]
    around = [openings_of({"drive": np.ones(5), "stope_1": own}) for own in depths]
    write_report(outcomes, GRID, SETTINGS, page, table, openings=around)
    text = page.read_text()
    section = text[text.index("<h2>Depth of failure at openings") :].split("<h2>")[1]
    assert "With other_order rock fails deeper at stope_1 (+4.0 m) than with mine_file." in section
    assert "No opening that both longer and mine_file mine shows a difference" in section
    assert section.index("stope_1</td>") < section.index("drive</td>")
    assert not re.search(r'(src|href)="(?!data:|#)', text)
    assert "Steps ahead of the record" in text
    rows = pd.read_csv(table)
    assert set(rows["plan"]) == {"mine_file", "other_order", "longer"}
    every = rows[(rows["plan"] == "longer") & (rows["step"] == "all") & (rows["opening"] == "any")].iloc[0]
    assert every["chance per year, damaging within 10 m"] == pytest.approx(
        plans[2].chance("any", 10.0, "damaging")[0], rel=1e-5
    )
    assert (tmp_path / "map.svg").exists()


def test_a_page_without_classes_has_no_chance(plans, tmp_path):
    run = drawn_run(tmp_path / "run", "own", 1)
    plain = make_outcome(slice_of([run], hazard={}), GRID)
    settings = PlansReportSlice.of({"mine": MINE})
    write_report([plain], GRID, settings, tmp_path / "report.html", tmp_path / "plans.csv")
    text = (tmp_path / "report.html").read_text()
    assert "Chance of large events near openings" not in text
    assert "hazard.magnitudes" in text
    with pytest.raises(InputError, match="made with other classes of size or distance"):
        write_report([plain], GRID, SETTINGS, tmp_path / "report.html", tmp_path / "plans.csv")
    other = PlansReportSlice.of({"mine": "another"})
    with pytest.raises(InputError, match="is of mine made_up, not of another"):
        write_report([plain], GRID, other, tmp_path / "report.html", tmp_path / "plans.csv")


def test_a_class_below_the_floor_has_no_chance_and_is_named(tmp_path):
    """Floor log P -2 is Mw -0.5 with the shear modulus of the fixtures: 2/3 (log10 2.5e10 - 2 - 9.1) = -0.468."""
    hazard = HAZARD | {"magnitudes": {"small": -0.8, "felt": -0.3}}
    plan = PlanSummary(make_outcome(slice_of(drawn_ensemble(tmp_path, 1), hazard=hazard), GRID))
    assert np.isnan(plan.chance("any", 10.0, "small")[0])
    assert np.isfinite(plan.chance("any", 10.0, "felt")[0])
    settings = PlansReportSlice.of({"mine": MINE, "hazard": hazard})
    said = [one for one in missing(Comparisons([plan]), settings.hazard) if "do not resolve" in one]
    assert said == [
        "There is no chance of events that are small (Mw −0.8), since the runs do not resolve such small ones. The "
        "smallest magnitude with a chance is Mw −0.46."
    ]
    assert matrix(plan, settings.hazard, Comparisons([plan]))[1]["cells"][0]["yearly"] == "–"
    write_report([plan.outcome], GRID, settings, tmp_path / "report.html", tmp_path / "plans.csv")


def empty_run(folder, kind: str) -> dict:
    return write_run(folder, kind, [(np.empty(0), np.empty((0, 3)))] * 2)


def test_ratios_contain_the_cells_only_where_both_plans_make_something_on_doubled_ones(tmp_path):
    """Both have a run on doubled cells; that of one makes nothing."""
    found = []
    for name in ("one", "other"):
        coarse = (
            drawn_run(tmp_path / f"{name}c", "coarse", 2) if name == "one" else empty_run(tmp_path / name, "coarse")
        )
        runs = [*drawn_ensemble(tmp_path / f"{name}o", len(name)), coarse]
        found.append(PlanSummary(make_outcome(slice_of(runs, name), GRID)))
    assert interval_contents(Comparisons(found)).startswith("Intervals of ratios contain chance. ")
    assert [
        one for one in missing(Comparisons(found), SETTINGS.hazard) if "makes nothing on cells of twice the size" in one
    ]


def test_a_plan_against_one_that_makes_nothing(tmp_path):
    """Either way round, and both alike."""
    some, none, too = (
        PlanSummary(make_outcome(slice_of(runs, name), GRID))
        for name, runs in (
            ("some", drawn_ensemble(tmp_path / "some", 1)),
            ("none", [empty_run(tmp_path / f"none{n}", kind) for n, kind in enumerate(["own", *["member"] * 4])]),
            ("too", [empty_run(tmp_path / f"too{n}", kind) for n, kind in enumerate(["own", *["member"] * 4])]),
        )
    )
    said = verdict(Comparisons([none, some]), SETTINGS.hazard)[0]
    assert re.fullmatch(
        r"none makes nothing in 2019-08 and 2019-09; some makes [\d.]+ events, [\d.]+ m³ of potency, in 2019-08 and "
        r"2019-09: a difference larger than chance explains\.", said
    )  # fmt: skip
    assert verdict(Comparisons([some, none]), SETTINGS.hazard)[0].startswith(
        "none releases 0 times the potency of some (95 % "
    )
    assert (
        verdict(Comparisons([none, too]), SETTINGS.hazard)[0]
        == "Neither too nor none makes anything in the steps that differ."
    )


@pytest.mark.parametrize("runs", [1, 4])
def test_plans_of_too_few_runs_get_no_verdict_no_interval_and_no_chance(tmp_path, runs):
    """Three times the events, and four runs: the ratios alone."""
    plans = [
        PlanSummary(make_outcome(slice_of(drawn_ensemble(tmp_path / name, seed, numbers)[:runs], name), GRID))
        for name, seed, numbers in (("less", 1, (40, 30)), ("more", 2, (120, 90)))
    ]
    said = verdict(Comparisons(plans), SETTINGS.hazard)
    assert re.search(r"It makes [\d.]+ times the events: too few runs to say, since a difference needs 5 runs", said[0])
    assert not [one for one in said if "Chance per year" in one]
    assert np.isnan(plans[0].chance("any", 10.0, "felt")[0])
    assert re.fullmatch(r"[\d.]+", plan_rows(Comparisons(plans))[1]["number_ratio"])
    assert {
        row["verdict"] for row in [*step_rows(Comparisons(plans), SETTINGS.hazard), *opening_rows(Comparisons(plans))]
    } == {
        "",
        "too few runs to say",
    }
    assert [one for one in missing(Comparisons(plans), SETTINGS.hazard) if "Set hazard.runs to 5 or more" in one]


def test_plans_that_are_not_told_apart_share_a_class(tmp_path):
    """A bound of the classes lies between the chances of two equal plans: both get one class, that of their mean."""
    plans = [
        PlanSummary(make_outcome(slice_of(drawn_ensemble(tmp_path / name, seed), name), GRID))
        for name, seed in (("one", 1), ("other", 4))
    ]
    chances = sorted(plan.chance("any", 10.0, "damaging")[0] for plan in plans)
    assert chances[0] < chances[1]
    hazard = SETTINGS.hazard.model_copy(update={"likelihoods": {"rare": 0.0, "likely": float(np.mean(chances)) - 1e-9}})
    assert {hazard.likelihood(chance) for chance in chances} == {"rare", "likely"}
    comparisons = Comparisons(plans)
    cells = [matrix(plan, hazard, comparisons)[0]["cells"][0] for plan in plans]
    assert [cell["likelihood"] for cell in cells] == ["likely", "likely"]
    assert cells[0]["ratio"] == ""
    assert re.fullmatch(r"[\d.]+ \([\d.]+ to [\d.]+\)", cells[1]["ratio"])


def test_parts_are_judged_only_where_whole_plans_differ(tmp_path):
    """Twenty pages of equal plans: hardly a verdict on any of them. Plans that differ are judged step by step."""
    said = []
    for seed in range(20):
        plans = [
            PlanSummary(make_outcome(slice_of(drawn_ensemble(tmp_path / f"{name}{seed}", seed + more), name), GRID))
            for name, more in (("one", 1), ("other", 50))
        ]
        rows = [
            *plan_rows(Comparisons(plans)),
            *step_rows(Comparisons(plans), SETTINGS.hazard),
            *opening_rows(Comparisons(plans)),
        ]
        said.append(any(row["differs"] for row in rows))
    assert np.mean(said) <= 0.05 + 3.0 * np.sqrt(0.05 * 0.95 / 20)
    assert "not judged by itself" in {row["verdict"] for row in rows}
    more = PlanSummary(make_outcome(slice_of(drawn_ensemble(tmp_path / "more", 99, (400, 250)), "more"), GRID))
    assert all(
        row["differs"] for row in step_rows(Comparisons([plans[0], more]), SETTINGS.hazard) if row["plan"] == "more"
    )


def test_a_plan_that_differs_in_more_than_its_sequence_is_said_to(tmp_path):
    run = drawn_run(tmp_path, "own", 1)
    plan = PlanSummary(make_outcome(slice_of([run], "other_rock", differs_in=["grid", "materials"]), GRID))
    said = [
        one
        for one in missing(Comparisons([plan]), SETTINGS.hazard)
        if one.startswith("other_rock is a mine file of its own")
    ]
    assert "differs from the mine file in grid and materials, too" in said[0]
    one_event = make_outcome(slice_of([drawn_run(tmp_path / "few", "own", 1, numbers=(0.0, 0.0))], hazard=HAZARD), GRID)
    one_event.attrs["law_events"] = 1
    assert law_texts([PlanSummary(one_event)]) == ["There is 1 event: too few for a law of sizes."]
