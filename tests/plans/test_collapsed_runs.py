"""Plans with runs in which rock finds no equilibrium: what is left out, compared, and said of them."""

import numpy as np
import pytest
from plan_fixtures import (
    HAZARD,
    MINE,
    STEPS,
    comparison_of,
    drawn_ensemble,
    drawn_run,
    made_up_grid,
    made_up_record,
    outcome_slice,
)

from common.errors import InputError
from plans.comparisons import Comparisons
from plans.differences import NUMBER, paired_sums
from plans.layout import ANY, LIKE_OWN, PlanSummary
from plans.outcome import make_outcome
from plans.page import write_report
from plans.runs import read_run
from plans.sentences import collapsed, missing
from plans.settings import PlansReportSlice, RunFiles
from plans.size_law import distinct_steps
from plans.tables import exposed_rows, plan_rows

GRID = made_up_grid()
LAST = STEPS[-1].name


def ensemble(folder, seed, lost=(), **options):
    """An own run and six members; lost: numbers of those that collapse in the last step, with a huge potency."""
    runs = []
    for number, kind in enumerate(["own", *["member"] * 6]):
        state = {"collapsed": LAST, "floor": -1.0} if number in lost else {}
        runs.append(drawn_run(folder / str(number), kind, 100 * seed + number, **(state | options)))
    return runs


def test_a_collapsed_member_is_left_out_as_if_it_had_not_run(tmp_path):
    """Means, floor, hazard and run count are those of the plan without it."""
    runs = ensemble(tmp_path, 1, lost=[2])
    with_it = PlanSummary(make_outcome(outcome_slice(runs), GRID))
    without = PlanSummary(make_outcome(outcome_slice([one for n, one in enumerate(runs) if n != 2]), GRID))
    assert with_it.runs == without.runs == 6
    assert with_it.floor == without.floor == -2.0
    assert with_it.means(with_it.steps) == without.means(without.steps)
    for name in ("chance", "yearly_chance", "expected", "expected_interval"):
        np.testing.assert_array_equal(with_it.outcome[name], without.outcome[name])


def test_plans_are_compared_by_the_runs_that_stand_in_both(tmp_path):
    """Runs of one number are a pair. A run that is left out in one plan is left out in the other, not its neighbour."""
    first, second = ensemble(tmp_path / "a", 1, lost=[2]), ensemble(tmp_path / "b", 5, lost=[4])
    both = [PlanSummary(make_outcome(outcome_slice(runs, name), GRID)) for name, runs in (("a", first), ("b", second))]
    numbers = [
        PlanSummary(make_outcome(outcome_slice(ensemble(tmp_path / name, seed), name), GRID)).outcome["number"]
        for name, seed in (("whole_a", 1), ("whole_b", 5))
    ]
    expected = [one.sel(opening=ANY).sum("step").values[[0, 1, 3, 5, 6]] for one in numbers]
    found = paired_sums([one.outcome for one in both], "number", LIKE_OWN, opening=ANY)
    np.testing.assert_array_equal(found, expected)
    ratio = Comparisons(both).whole(both[1], NUMBER).value
    assert ratio == pytest.approx(expected[1].mean() / expected[0].mean())


def test_too_few_runs_are_said_to_be_so_by_what_is_left(tmp_path):
    """Five runs each, one lost in each plan and not the same: three pairs are left, and two more have to stand."""
    plans = []
    for seed, (name, lost) in enumerate([("a", 2), ("b", 4)]):
        runs = [one for n, one in enumerate(ensemble(tmp_path / name, seed + 1, lost=[lost])) if n < 5]
        plans.append(PlanSummary(make_outcome(outcome_slice(runs, name), GRID)))
    comparisons, settings = Comparisons(plans), PlansReportSlice.of({"mine": MINE, "hazard": HAZARD}).hazard
    assert comparisons.pairs(plans[1]) == 3
    said = [line for line in missing(comparisons, settings) if "too few to say" in line]
    assert said[0].startswith("Of 5 runs of each plan, 3 are left, too few")
    assert said[0].endswith("Set hazard.runs to 7 or more.")


def test_a_plan_short_of_runs_takes_no_chance_from_the_others(tmp_path):
    """It has none itself. In whatever order plans stand."""
    many = make_outcome(outcome_slice(ensemble(tmp_path / "many", 1), "many"), GRID)
    few = make_outcome(outcome_slice(ensemble(tmp_path / "few", 3, lost=[1, 2, 3]), "few"), GRID)
    settings = PlansReportSlice.of({"mine": MINE, "hazard": HAZARD}).hazard
    for order in ([many, few], [few, many]):
        plans = [PlanSummary(one) for one in order]
        assert [row["opening"] for row in exposed_rows(plans, settings)]
        known = Comparisons(plans).class_chance(plans[0], 10.0, "felt")
        assert known == PlanSummary(many).chance(ANY, 10.0, "felt")[0]


def test_the_law_of_sizes_does_not_depend_on_the_order_of_plans(tmp_path):
    """Two plans share a step, of which one lacks a run that collapses later."""
    shared = ensemble(tmp_path / "shared", 1)
    lost = ensemble(tmp_path / "lost", 2, lost=[2])
    other = [
        {**one, "events": [first["events"][0], one["events"][1]], "states": [first["states"][0], one["states"][1]]}
        for first, one in zip(shared, lost, strict=True)
    ]
    found = []
    for plans in ([shared, other], [other, shared]):
        read = [[read_run(RunFiles.of(run, "runs"), STEPS, MINE) for run in plan] for plan in plans]
        stands = [[run for run in plan if not any(step.collapsed for step in run)] for plan in read]
        found.append(sorted(sorted(one.file for one in step) for step in distinct_steps(stands)))
    assert found[0] == found[1]
    assert [len(step) for step in found[0]].count(7) == 2  # the shared one, and the second of the plan that stands


def test_a_collapsed_coarse_run_says_nothing_of_the_cells(tmp_path):
    own = drawn_ensemble(tmp_path, 1)
    stands, lost = (
        PlanSummary(
            make_outcome(outcome_slice([*own, drawn_run(tmp_path / f"c{state}", "coarse", 9, collapsed=state)]), GRID)
        )
        for state in ("", LAST)
    )
    assert "cells" in stands.outcome.attrs["contains"]
    assert "cells" in lost.outcome.attrs["lacks"]
    assert stands.has_runs("coarse")
    assert not lost.has_runs("coarse")


def test_draws_of_the_rock_that_collapse_leave_the_others(tmp_path):
    """A draw counts where it stands in plan and record: four of five do, in whatever order."""
    own = drawn_ensemble(tmp_path, 1)
    draws = [drawn_run(tmp_path / f"d{n}", "draw", 20 + n, collapsed=LAST if n == 1 else "") for n in range(5)]
    others = [one for n, one in enumerate(draws) if n != 1]
    recorded = {"recorded_steps": [STEPS[0].given()]}

    def of(runs):
        first_step = [{**one, "events": one["events"][:1], "states": one["states"][:1]} for one in runs]
        given = outcome_slice(runs, **recorded, recorded_runs=first_step)
        return make_outcome(given, GRID, made_up_record(30, 7), comparison_of())

    with_it, without = of([*own, *draws]), of([*own, *others])
    assert "rock" in with_it.attrs["contains"]
    np.testing.assert_allclose(with_it["expected_interval"], without["expected_interval"])


def test_a_record_is_not_compared_with_an_own_run_that_collapsed_before_its_end(tmp_path):
    own = ensemble(tmp_path, 1)
    lost = ensemble(tmp_path / "lost", 1, lost=[0], collapsed=STEPS[0].name)
    recorded = {"recorded_steps": [one.given() for one in STEPS]}
    record = made_up_record(50, 7, end="2019-10-01")
    for runs, holds in ((own, True), (lost, False)):
        made = make_outcome(outcome_slice(own, **recorded, recorded_runs=runs), GRID, record, comparison_of())
        assert ("record" in made.attrs["contains"]) is holds


def page_of(folder, outcomes):
    settings = PlansReportSlice.of({"mine": MINE, "hazard": HAZARD})
    write_report(outcomes, GRID, settings, folder / "report.html", folder / "plans.csv")
    return (folder / "report.html").read_text(encoding="utf-8")


def test_the_page_leaves_out_a_plan_whose_own_run_collapses_and_says_so_first(tmp_path):
    """Also where it is the plan that others would be compared with."""
    good = make_outcome(outcome_slice(ensemble(tmp_path / "good", 1), "good"), GRID)
    bad = make_outcome(outcome_slice(ensemble(tmp_path / "bad", 3, lost=[0, 1, 2, 3, 4, 5, 6]), "bad"), GRID)
    some = make_outcome(outcome_slice(ensemble(tmp_path / "some", 4, lost=[1, 3]), "some"), GRID)
    (tmp_path / "page").mkdir()
    page = page_of(tmp_path / "page", [bad, good, some])
    first = page.index(f"bad is left out: in its own run rock finds no equilibrium in step {LAST}")
    assert page.index("<h1>") < first < page.index("the runs make: events")
    assert "In 2 of 7 runs of some rock finds no equilibrium. They are left out" in page
    assert "bad releases" not in page
    assert "some releases" in page
    assert "bad" not in (tmp_path / "page" / "plans.csv").read_text(encoding="utf-8")
    with pytest.raises(InputError, match=rf"no equilibrium in any plan \(bad: in step {LAST}\)"):
        page_of(tmp_path / "page", [bad])
    assert collapsed([PlanSummary(good)]) == []


def test_floors_are_not_those_of_runs_that_collapse(tmp_path):
    """Nor of a compared plan that is left out as a whole."""
    own = ensemble(tmp_path / "own", 1)
    other = [one | {"states": []} for one in ensemble(tmp_path / "other", 2, lost=[0], floor=-1.5)]
    outcome = make_outcome(outcome_slice(own, compared_runs=[*own, *other]), GRID)
    assert outcome.attrs["floor"] == -2.0
    member = [one | {"states": []} for one in ensemble(tmp_path / "member", 2, lost=[3])]
    outcome = make_outcome(outcome_slice(own, compared_runs=[*own, *member]), GRID)
    assert outcome.attrs["floor"] == -2.0


def test_fallen_rock_stands_in_the_table_of_plans(tmp_path):
    outcome = PlanSummary(make_outcome(outcome_slice(ensemble(tmp_path, 1, fallen=7.5)), GRID))
    assert outcome.fallen == pytest.approx(15.0)
    assert plan_rows(Comparisons([outcome]))[0]["fallen"] == "15.0"
