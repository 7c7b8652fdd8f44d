"""Plans that are compared: coverage of a known ratio, equal plans, what cells and rock add, and the words."""

import numpy as np
import pytest
import xarray as xr
from plan_fixtures import HAZARD, STEPS, drawn_ensemble, drawn_events, drawn_run, made_up_grid, outcome_slice, write_run
from scipy.stats import t, ttest_1samp

from catalogs.settings import DatedStep
from common.errors import InputError
from plans.differences import NUMBER, POTENCY, compare_plans, paired_interval, steps_with_other_runs
from plans.outcome import make_outcome
from verification.answers.statistics.samples import simulated_sizes

NAMES = [step.name for step in STEPS]
BOTH = (NAMES, NAMES)
EQUAL = (1.0, 1.0)  # each event adds one to a number


def drawn_plan(generator, runs: int, mean: float, b: float, clusters: float, span: float = 2.5) -> tuple:
    """Number and summed size of each run of a plan, whose events come in clusters of a geometric number."""
    found = []
    for _ in range(runs):
        number = generator.geometric(1.0 / clusters, generator.poisson(mean / clusters)).sum()
        found.append((float(number), np.sum(10.0 ** simulated_sizes(generator, int(number), b, span))))
    return tuple(np.array(found).T)


def interval_of(quantity: int, *plans: tuple) -> np.ndarray:
    """Interval of the ratio of numbers (0) or summed sizes (1) of two such plans."""
    sizes = [plan[quantity].sum() / max(plan[0].sum(), 1.0) for plan in plans]
    return paired_interval(plans[0][quantity], plans[1][quantity], sizes)


@pytest.mark.parametrize("runs", [5, 9])
@pytest.mark.parametrize(("mean", "b", "clusters"), [(1, 0.9, 1.0), (40, 0.6, 1.0), (10, 0.8, 4.0), (80, 0.6, 8.0)])
def test_equal_plans_are_hardly_ever_told_apart(runs, mean, b, clusters):
    """400 pairs of equal plans: 0.05 and three standard errors, 0.033, whatever clusters and tails."""
    generator = np.random.default_rng(runs + mean)
    pairs = [[drawn_plan(generator, runs, mean, b, clusters) for _ in range(2)] for _ in range(400)]
    for quantity in (0, 1):
        ends = np.array([interval_of(quantity, *pair) for pair in pairs])
        assert np.mean((ends[:, 0] > 1.0) | (ends[:, 1] < 1.0)) <= 0.05 + 0.033


@pytest.mark.parametrize(
    ("runs", "mean", "ratio", "b", "clusters"),
    [(5, 1, 3.0, 0.6, 1.0), (5, 40, 1.5, 1.2, 3.0), (9, 10, 3.0, 0.8, 4.0), (9, 80, 3.0, 0.9, 1.0)],
)
def test_intervals_hold_a_known_ratio(runs, mean, ratio, b, clusters):
    """300 pairs of plans of known rates: 0.93 less three standard errors, 0.044."""
    generator = np.random.default_rng(runs + mean)
    held = []
    for _ in range(300):
        pair = [drawn_plan(generator, runs, mean * times, b, clusters) for times in (ratio, 1.0)]
        ends = [interval_of(quantity, *pair) for quantity in (0, 1)]
        held.append([np.isnan(one).any() or one[0] <= ratio <= one[1] for one in ends])
    assert (np.mean(held, axis=0) >= 0.93 - 0.044).all()


def test_the_interval_is_that_of_fieller():
    """Its ends are the ratios at which Student's t of the paired differences is at its limit, here by bisection."""
    generator = np.random.default_rng(3)
    first, second = (100.0 * generator.gamma(9.0, size=7) * scale for scale in (3.0, 1.0))
    interval = paired_interval(first, second, EQUAL)
    for end, inside in zip(interval, (1.01, 0.99), strict=True):
        assert ttest_1samp(first - end * second, 0.0).pvalue == pytest.approx(0.05)
        assert ttest_1samp(first - inside * end * second, 0.0).pvalue > 0.05
    np.testing.assert_allclose(paired_interval(second, first, EQUAL)[::-1], 1.0 / interval)


def test_runs_that_agree_by_chance_vary_as_independent_events_do():
    """One event in each of five runs against two in each, or against none: not told apart. A hundred times as many are,
    and the interval is as wide as that of independent events."""
    one = np.ones(5)
    low, high = paired_interval(one, 2.0 * one, EQUAL)
    assert low < 0.1
    assert high > 1.0
    low, high = paired_interval(100.0 * one, 200.0 * one, EQUAL)
    assert np.log(high / low) == pytest.approx(2.0 * t.isf(0.025, 4) * np.sqrt(1 / 500 + 1 / 1000), rel=0.02)
    # the odds of 5.5 to 0.5 gamma variates; 20 events more would raise the end fivefold
    draws = np.random.default_rng(1).standard_gamma([[5.5], [0.5]], size=(2, 400_000))
    expected = np.quantile(draws[0] / draws[1], 0.025)
    assert paired_interval(one, 0.0 * one, EQUAL)[0] == pytest.approx(expected, rel=0.02)
    np.testing.assert_allclose(paired_interval(7.0 * one, 0.0 * one, (7.0, 1.0))[0], expected, rtol=0.02)


def test_runs_that_vary_alike_make_a_narrower_interval_that_holds():
    """300 pairs of ensembles; nine tenths of what their rates vary by is common to runs of one number: 0.93 less three
    standard errors, 0.044. Taken in another order, the intervals are wider by half."""
    generator = np.random.default_rng(9)
    held, widths = [], []
    for _ in range(300):
        common = 2.0 * generator.standard_gamma(0.45 * 150, 9)
        number = [
            generator.poisson(ratio * (common + 2.0 * generator.standard_gamma(0.05 * 150, 9))).astype(float)
            for ratio in (1.5, 1.0)
        ]
        paired, alone = (paired_interval(number[0], np.roll(number[1], by), EQUAL) for by in (0, 1))
        held.append(paired[0] <= 1.5 <= paired[1])
        widths.append([np.log(one[1] / one[0]) for one in (paired, alone)])
    assert np.mean(held) >= 0.93 - 0.044
    assert np.mean(widths, axis=0)[1] > 1.5 * np.mean(widths, axis=0)[0]


def outcome(folder, runs, **others) -> xr.Dataset:
    return make_outcome(outcome_slice(runs, **others), made_up_grid())


def test_a_plan_beside_itself(tmp_path):
    """Its own runs are said to be the same. As other files with the same events: ratio 1, in the interval."""
    generator = np.random.default_rng(1)
    kinds = ["own", *["member"] * 4]
    events = [[drawn_events(count, generator) for count in (50, 30)] for _ in kinds]
    one, other = (
        outcome(
            tmp_path,
            [write_run(tmp_path / f"{plan}{n}", kind, events[n]) for n, kind in enumerate(kinds)],
            plan=plan,
        )
        for plan in ("one", "other")
    )
    assert steps_with_other_runs(one, one) == []
    found = compare_plans(one, one, POTENCY, BOTH)
    assert found.is_shared
    assert found.value == 1.0
    assert steps_with_other_runs(one, other) == NAMES
    for quantity in (NUMBER, POTENCY):
        for opening in ("any", "stope_1"):
            found = compare_plans(one, other, quantity, BOTH, opening)
            assert found.value == 1.0
            # Pairs that are the same tell nothing apart, but few numbers may agree by chance.
            assert found.interval[0] <= 1.0 <= found.interval[1]
            np.testing.assert_allclose(np.prod(found.interval), 1.0, rtol=0.01)
            assert found.verdict == "difference within chance"
            assert found.contains == ("chance",)
            assert set(found.lacks) == {"cells", "rock"}


def test_a_shared_step_is_no_difference(tmp_path):
    """The second step alone has other runs."""
    run, other = (drawn_run(tmp_path / name, "own", seed) for name, seed in (("one", 1), ("two", 2)))
    mixed = {**other, **{key: [run[key][0], other[key][1]] for key in ("events", "states")}}
    plans = [outcome(tmp_path, [run]), outcome(tmp_path, [mixed], plan="mixed")]
    assert steps_with_other_runs(plans[1], plans[0]) == ["2019-09"]
    assert compare_plans(plans[1], plans[0], NUMBER, (["2019-08"], ["2019-08"])).is_shared
    assert not compare_plans(plans[1], plans[0], NUMBER, (["2019-09"], ["2019-09"])).is_shared


def test_other_dates_alone_make_no_other_run(tmp_path):
    """The same rock, and events that are dated otherwise. Other events from the same states are another run."""
    generator = np.random.default_rng(2)
    events = [drawn_events(count, generator) for count in (50, 30)]
    later = [DatedStep(name=step.name, start=step.start, end="2019-08-20") if not number else step
             for number, step in enumerate(STEPS)]  # fmt: skip
    own = outcome(tmp_path, [write_run(tmp_path / "a" / "run", "own", events)])
    dated = outcome(
        tmp_path,
        [write_run(tmp_path / "b" / "run", "own", events, steps=later)],
        plan="dated",
        steps=[step.given() for step in later],
    )
    assert steps_with_other_runs(dated, own) == []
    assert compare_plans(dated, own, POTENCY, BOTH).verdict == "the same runs in both plans"
    fewer = [(size[:-1], place[:-1]) for size, place in events]
    assert steps_with_other_runs(outcome(tmp_path, [write_run(tmp_path / "c" / "run", "own", fewer)]), own) == NAMES


def test_a_member_more_is_no_shared_step(tmp_path):
    run, member = drawn_run(tmp_path / "one", "own", 1), drawn_run(tmp_path / "two", "member", 2)
    assert steps_with_other_runs(outcome(tmp_path, [run]), outcome(tmp_path, [run, member])) == NAMES


@pytest.mark.parametrize("runs", [1, 6])
def test_a_large_difference_is_larger_than_chance_explains(tmp_path, runs):
    plans = []
    for plan, numbers in (("more", (120, 90)), ("less", (40, 30))):
        kinds = ["own", *["member"] * (runs - 1)]
        made = [drawn_run(tmp_path / plan / str(seed), kind, seed, numbers) for seed, kind in enumerate(kinds)]
        plans.append(outcome(tmp_path, made, plan=plan))
    found = compare_plans(*plans, NUMBER, BOTH)
    assert found.is_significant == (runs == 6)
    assert found.verdict == ("larger than chance explains" if runs == 6 else "too few runs to say")
    assert ("runs" in found.lacks) == np.isnan(found.interval).all() == (runs == 1)
    back = compare_plans(*plans[::-1], NUMBER, BOTH)
    np.testing.assert_allclose(back.interval[::-1], 1.0 / found.interval)


def test_cells_and_rock_widen_the_interval(tmp_path):
    """The ratio of numbers is 3 on own cells and 1 on doubled ones: ln 3 times 1.25 is added in quadrature to chance.
    Draws of the rock scatter about the ratio, of Student's t with two degrees of freedom."""

    def plan(name: str, own, coarse, draws) -> xr.Dataset:
        generator = np.random.default_rng(3)
        kinds = [("own", own), *([("coarse", coarse)] if coarse else []), *(("draw", one) for one in draws)]
        made = []
        for number, (kind, count) in enumerate(kinds):
            events = [drawn_events(count, generator), drawn_events(count, generator)]
            made.append(write_run(tmp_path / name / str(number), kind, events))
        made += [
            drawn_run(tmp_path / name / f"member_{n}", "member", n, (spread * own, spread * own))
            for n, spread in enumerate((0.8, 0.9, 1.1, 1.2))
        ]
        return outcome(tmp_path, made, plan=name)

    alone = compare_plans(plan("a1", 90, 0, []), plan("b1", 30, 0, []), NUMBER, BOTH)
    value = alone.value
    cells = compare_plans(plan("a2", 90, 50, []), plan("b2", 30, 50, []), NUMBER, BOTH)
    assert alone.is_significant
    assert cells.contains == ("chance", "cells")
    np.testing.assert_allclose(cells.judged_by_chance, alone.interval)
    for side in range(2):
        of_chance, both = (np.log(one.interval[side] / value) for one in (alone, cells))
        assert abs(both) == pytest.approx(np.hypot(of_chance, 1.25 * np.log(3.0)))
    assert not cells.is_significant
    assert cells.verdict == "larger than chance explains, but cell size may explain it"

    rock = compare_plans(plan("a3", 90, 0, [60, 90, 120]), plan("b3", 30, 0, [30, 30, 30]), NUMBER, BOTH)
    values = np.log([2.0, 3.0, 4.0])
    half = 4.3027 * values.std(ddof=1) * np.sqrt(4.0 / 3.0)
    for side, sign in enumerate((-1.0, 1.0)):
        by_rock = max(0.0, sign * (values.mean() + sign * half - np.log(value)))
        expected = np.hypot(np.log(alone.interval[side] / value), by_rock)
        assert abs(np.log(rock.interval[side] / value)) == pytest.approx(expected, rel=1e-4)
    assert rock.contains == ("chance", "rock")


def test_no_event_in_a_plan_leaves_its_side_open(tmp_path):
    nothing = [(np.empty(0), np.empty((0, 3)))] * 2
    kinds = ["own", *["member"] * 4]
    empty = [write_run(tmp_path / f"none{n}", kind, nothing) for n, kind in enumerate(kinds)]
    none = outcome(tmp_path, empty, plan="none")
    some = outcome(tmp_path, drawn_ensemble(tmp_path / "some", 1))
    more, less = compare_plans(some, none, NUMBER, BOTH), compare_plans(none, some, NUMBER, BOTH)
    assert np.isnan(more.value)
    assert more.interval[0] > 4.0
    assert np.isinf(more.interval[1])
    assert less.value == 0.0
    assert less.interval[0] == 0.0
    none_too = outcome(tmp_path, [write_run(tmp_path / f"too{n}", kind, nothing) for n, kind in enumerate(kinds)])
    assert compare_plans(none, none_too, NUMBER, BOTH).verdict == "neither plan makes anything"


def test_mirrored_plans_are_equal(tmp_path):
    """The mine mirrored at x = 16 m with its events: every total is the same, near every opening."""
    generator = np.random.default_rng(4)
    events = [drawn_events(count, generator) for count in (50, 30)]
    mirrored = [(size, place * [-1.0, 1.0, 1.0] + [32.0, 0.0, 0.0]) for size, place in events]
    one = outcome(tmp_path, [write_run(tmp_path / "one", "own", events)])
    other = make_outcome(
        outcome_slice([write_run(tmp_path / "other", "own", mirrored)], plan="mirrored"), made_up_grid(mirrored=True)
    )
    for opening in one["opening"].values:
        for step in NAMES:
            found = compare_plans(one, other, POTENCY, ([step], [step]), opening)
            assert np.isnan(found.value) or found.value == pytest.approx(1.0)
    assert len(HAZARD["distances"]) == one.sizes["distance"]


def test_plans_are_counted_from_one_floor(tmp_path):
    """The same events, resolved from log P -2 on in one plan and from -1.5 on in the other: ratio 1. Without the floors
    of the others, the outcomes are no pair."""
    generator = np.random.default_rng(4)
    events = [drawn_events(count, generator) for count in (90, 60)]
    runs = [write_run(tmp_path / f"{floor}", "own", events, floor=floor) for floor in (-2.0, -1.5)]
    floors = [{key: run[key] for key in ("kind", "events")} for run in runs[::-1]]
    plans = [
        outcome(tmp_path, [run], plan=f"plan_{number}", compared_runs=[other])
        for number, (run, other) in enumerate(zip(runs, floors, strict=True))
    ]
    assert [plan.attrs["floor"] for plan in plans] == pytest.approx([-1.5, -1.5])
    found = compare_plans(*plans, NUMBER, BOTH)
    assert found.value == 1.0
    alone = outcome(tmp_path, runs[:1], plan="alone")
    with pytest.raises(
        InputError, match=r"events of alone are counted from log P -2 on, those of plan_1 from -1\.5 on"
    ):
        compare_plans(alone, plans[1], NUMBER, BOTH)


def test_plans_that_share_steps_have_one_law_of_sizes(tmp_path):
    """Three plans of two steps. The first step is the same in all, the second in two: each event counts once, and all
    chances have the same law with the same end. Rock of one plan's posterior releases more, which changes nothing."""
    runs: dict[str, list[dict]] = {"a": [], "b": [], "c": []}
    generator = np.random.default_rng(6)
    for number, kind in enumerate(["own", *["member"] * 4]):
        first, second, other = (drawn_events(count, generator) for count in (40, 25, 60))
        for name, events in (("a", [first, second]), ("b", [first, other])):
            runs[name].append(write_run(tmp_path / name / str(number), kind, events))
        one = runs["a"][-1]["events"][:1]
        runs["b"][-1]["events"] = one + runs["b"][-1]["events"][1:]
        runs["c"].append(dict(runs["b"][-1]))
    runs["a"].append(drawn_run(tmp_path / "a" / "draw", "draw", 7, (900, 900)))
    made = []
    for name, own in runs.items():
        compared = [{"kind": run["kind"], "events": run["events"]} for of in runs if of != name for run in runs[of]]
        made.append(outcome(tmp_path, own, plan=name, compared_runs=compared))
    assert [one.attrs["law_events"] for one in made] == [5 * (40 + 25 + 60)] * 3
    for key in ("law_b", "law_b_interval", "law_bound", "law_bound_interval"):
        np.testing.assert_array_equal(made[1].attrs[key], made[0].attrs[key])
        np.testing.assert_array_equal(made[2].attrs[key], made[0].attrs[key])


def test_a_companion_of_another_plan_raises_the_shared_floor_only(tmp_path):
    own, other = (drawn_run(tmp_path / name, "own", 1) for name in ("own", "other"))
    coarse = drawn_run(tmp_path / "coarse", "coarse", 2, floor=-1.2)
    made = outcome(
        tmp_path, [own], compared_runs=[{key: run[key] for key in ("kind", "events")} for run in (other, coarse)]
    )
    assert made.attrs["floor"] == pytest.approx(-2.0)
    assert made.attrs["shared_floor"] == pytest.approx(-1.2)
