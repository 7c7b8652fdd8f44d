"""Depth of failure, plan beside plan: verdicts on drawn truths, and rows and sentences on plans made by hand."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as some

from common.opening_table import RUN_FIELDS
from plans.opening_depths import (
    MAX_ROWS,
    MIN_RUNS,
    OpeningDepths,
    depth_rows,
    depth_section,
    depth_sentences,
    paired_difference,
)

CELL = 2.0


def summary(name: str, runs: int, stands: list[bool] | None = None) -> SimpleNamespace:
    """What of PlanSummary the comparison reads, of a plan with its own run, members and one run on doubled cells."""
    kinds = ["own", *["member"] * (runs - 1), "coarse"]
    stood = np.array([*(stands or [True] * runs), True])
    return SimpleNamespace(name=name, stands=stood, outcome={"run_kind": xr.DataArray(kinds, dims="run")})


def openings_of(depths: dict[str, np.ndarray], step: str = "2019-09", side: str = "roof") -> xr.Dataset:
    """opening_runs.nc of depths (run,) m by opening; the largest is 1 m more, the closure a tenth of a per cent."""
    p90 = np.column_stack(list(depths.values())).astype(float)
    values = {
        "run": ["own", *["member"] * (len(p90) - 1)],
        "opening": list(depths),
        "filled": [0] * len(depths),
        "depth_p90": p90,
        "depth_largest": p90 + 1.0,
        "closure": 0.001 * p90,
        "failed_volume": 100.0 * p90,
        "side": np.where(p90 > 0, side, ""),
    }
    return xr.Dataset(
        {field.name: (field.dims, np.array(values[field.name], field.dtype), field.attributes) for field in RUN_FIELDS},
        attrs={"step": step, "fine_cell": CELL},
    )


def compared(*plans: dict[str, np.ndarray]) -> OpeningDepths:
    runs = [len(next(iter(plan.values()))) for plan in plans]
    summaries = [summary(f"plan_{number}", count) for number, count in enumerate(runs)]
    return OpeningDepths(summaries, [openings_of(plan) for plan in plans])


def drawn_depths(
    generator: np.random.Generator, mean: np.ndarray, scale: float = 1.0, runs: int = 5
) -> dict[str, np.ndarray]:
    """Depths of openings (opening,) m of runs: random strength, in multiples of half a cell as on the grid."""
    scatter = generator.gamma(2.0, 0.5 * scale, (runs, len(mean)))
    depth = np.maximum(np.rint(2.0 * (mean + scatter) / CELL) * CELL / 2.0, 0.0)
    return {f"opening_{number}": depth[:, number] for number in range(len(mean))}


# ---- verdicts against known truths ----


def test_identical_plans_never_differ():
    """The same runs: every difference is none, whatever the depths."""
    same = drawn_depths(np.random.default_rng(1), np.linspace(0.0, 20.0, 12))
    depths = compared(same, same)
    assert {row["verdict"] for row in depth_rows(depths)} == {"", "none"}
    assert depth_sentences(depths) == [
        "No opening that both plan_1 and plan_0 mine shows a difference in depth of failure. "
        "The depth differs at 12 openings by less than half a cell (1.0 m)."
    ]


@pytest.mark.parametrize("scatter", [1.0, 8.0])
def test_equal_plans_of_other_runs_differ_on_one_page_of_twenty_at_most(scatter):
    """400 pages of twelve openings of equal truth, of little scatter between runs and of much; binomial scatter of the
    count of pages allowed for."""
    generator, mean = np.random.default_rng(2), np.linspace(1.0, 9.0, 12)
    pages = [
        any(
            row["differs"] or "*" in row["closure"]
            for row in depth_rows(compared(*(drawn_depths(generator, mean, scatter) for _ in range(2))))
        )
        for _ in range(400)
    ]
    assert np.mean(pages) <= 0.05 + 3.0 * np.sqrt(0.05 * 0.95 / 400)


def test_a_pillar_that_fails_is_found_and_named_alone():
    """Of eight openings one fails five metres deeper in the second plan: it is named in nearly all draws."""
    generator, mean = np.random.default_rng(3), np.linspace(1.0, 9.0, 8)
    worse = mean + np.where(np.arange(8) == 2, 5.0, 0.0)
    found = []
    for _ in range(200):
        depths = compared(drawn_depths(generator, mean), drawn_depths(generator, worse))
        kinds = [depths.difference(depths.plans[1], f"opening_{number}").kind for number in range(8)]
        found.append((kinds[2] == "more", any(kind in ("more", "less") for kind in kinds[:2] + kinds[3:])))
    named, others = np.mean(found, axis=0)
    assert named > 0.9
    assert others <= 0.05 + 3.0 * np.sqrt(0.05 * 0.95 / 200)
    sentence = depth_sentences(
        compared({"a": np.full(5, 3.0), "b": np.ones(5)}, {"a": np.full(5, 8.0), "b": np.ones(5)})
    )
    assert sentence == [
        "With plan_1 rock fails deeper at a (+5.0 m) than with plan_0. "
        "The depth differs at 1 opening by less than half a cell (1.0 m). "
        "With plan_1 walls close more at a (+5.0 mm) than with plan_0."
    ]


def test_closures_are_judged_by_themselves():
    """As deep in both plans: one opening closes half as much, one by 9 % less, one differs by chance."""
    alike = dict.fromkeys(("half", "nearly", "scattered"), np.full(5, 4.0))
    closures = [
        {
            "half": np.linspace(0.09, 0.11, 5),
            "nearly": np.full(5, 0.1),
            "scattered": np.array([0.2, 0.02, 0.1, 0.01, 0.3]),
        },
        {
            "half": np.linspace(0.04, 0.06, 5),
            "nearly": np.full(5, 0.091),
            "scattered": np.array([0.1, 0.1, 0.2, 0.2, 0.3]),
        },
    ]
    plans = [
        openings_of(alike).assign(closure=(("run", "opening"), np.column_stack(list(one.values())))) for one in closures
    ]
    depths = OpeningDepths([summary("a", 5), summary("b", 5)], plans)
    assert [depths.closure(depths.plans[1], name).kind for name in alike] == ["less", "none", "chance"]
    assert [row["closure"] for row in depth_rows(depths) if row["plan"] == "b"] == ["50 (−50) *", "91", "180 (+54)"]
    assert depth_sentences(depths)[0].endswith("With b walls close less at half (−50 mm) than with a.")
    assert depths.difference(depths.plans[1], "half").kind == "none"


def test_the_interval_holds_the_true_difference():
    """A true difference of 3 m and normal scatter, 2,000 times: 95 of 100 intervals at least hold it."""
    generator, inside = np.random.default_rng(4), []
    for _ in range(2000):
        pair = 5.0 + generator.normal(0.0, 2.0, 5)
        other = pair + 3.0 + generator.normal(0.0, 1.5, 5)
        low, high = paired_difference(pair, other, CELL / 2, 10).interval
        inside.append(low <= 3.0 <= high)
    assert np.mean(inside) >= 0.95 - 3.0 * np.sqrt(0.05 * 0.95 / 2000)


@settings(max_examples=100, deadline=None)
@given(
    some.lists(some.tuples(some.floats(0.0, 30.0), some.floats(0.0, 30.0)), min_size=1, max_size=12),
    some.floats(0.1, 5.0),
    some.integers(1, 50),
)
def test_swapped_plans_and_other_units_say_the_same(pairs, cell, comparisons):
    """The difference turns its sign, its interval is mirrored, the verdict opposite; a scale changes lengths alone."""
    first, second = np.array(pairs).T
    one, other = (paired_difference(*pair, cell / 2, comparisons) for pair in ((first, second), (second, first)))
    opposite = {"more": "less", "less": "more"}
    assert other.kind == opposite.get(one.kind, one.kind)
    np.testing.assert_allclose(other.interval, -one.interval[::-1], atol=1e-9)
    scaled = paired_difference(4.0 * first, 4.0 * second, 2.0 * cell, comparisons)
    assert scaled.kind == one.kind
    assert scaled.mean == pytest.approx(4.0 * one.mean)
    order = np.random.default_rng(0).permutation(len(first))
    assert paired_difference(first[order], second[order], cell / 2, comparisons).kind == one.kind
    if np.abs(second - first).max() < cell / 2:
        assert one.kind == "none"


def test_a_difference_below_half_a_cell_is_none_however_many_runs_agree():
    assert paired_difference(np.full(200, 3.0), np.full(200, 3.99), CELL / 2, 1).kind == "none"
    assert paired_difference(np.full(200, 3.0), np.full(200, 4.01), CELL / 2, 1).kind == "more"


def test_few_runs_say_nothing_of_chance():
    """Four pairs, and a run that does not stand: no interval, no verdict."""
    for count in range(1, MIN_RUNS):
        found = paired_difference(np.zeros(count), np.full(count, 9.0), CELL / 2, 1)
        assert found.kind == "few"
        assert np.isnan(found.interval).all()
    plan = [summary("first", 5), summary("other", 5, [True, True, False, True, True])]
    both = [openings_of({"a": np.zeros(5)}), openings_of({"a": np.array([9.0, 9, -999, 9, 9])})]
    depths = OpeningDepths(plan, both)
    assert depths.difference(depths.plans[1], "a").kind == "few"
    assert depths.plans[1].mean("a", "depth_p90") == 9.0
    assert depth_sentences(depths) == [
        "other and first differ by more than half a cell (1.0 m) at a (+9.0 m): too few runs to say whether chance "
        "explains it, since that needs 5."
    ]


# ---- rows ----


def test_rows_have_means_and_differences_of_each_plan_the_deepest_opening_first():
    first = {"drive": np.full(5, 2.0), "stope": np.full(5, 6.0)}
    other = {"drive": np.full(5, 2.5), "stope": np.full(5, 10.0), "extra": np.full(5, 4.0)}
    rows = depth_rows(compared(first, other))
    assert [(row["opening"], row["plan"]) for row in rows] == [
        ("stope", "plan_0"), ("", "plan_1"), ("extra", "plan_1"), ("drive", "plan_0"), ("", "plan_1"),
    ]  # fmt: skip
    stope, extra, drive = rows[1], rows[2], rows[4]
    assert (stope["p90"], stope["largest"], stope["verdict"]) == ("10", "11 (+4.0)", "deeper")
    assert stope["difference"] == "+4.0 (+3.0 to +5.0)"  # t of four degrees, 2 m / sqrt 6 over sqrt 5
    assert (stope["closure"], stope["volume"]) == ("10 (+4.0) *", "1\u202f000 (+400)")
    assert extra["verdict"] == "not in plan_0"
    assert (drive["difference"], drive["largest"], drive["verdict"]) == ("–", "3.5", "none")
    assert "Only plan_1 mines extra." in depth_sentences(compared(first, other))[0]
    assert "Only plan_0 mines extra." in depth_sentences(compared(other, first))[0]


def test_many_openings_are_those_with_the_deepest_failure():
    many = {f"stope_{number}": np.full(5, float(number)) for number in range(40)}
    plans = [summary("a", 5), summary("b", 5)]
    found = depth_section(plans, [openings_of(many), openings_of(many)])
    assert [row["opening"] for row in found["rows"]][::2] == [f"stope_{39 - number}" for number in range(MAX_ROWS)]
    assert found["left_out"] == "15 of 40 openings are shown. "
    assert found["half_cell"] == "1.0"
    assert depth_section(plans, []) == {}


def test_plans_without_a_common_opening_and_plans_of_other_lengths():
    plans = [summary("a", 5), summary("b", 5)]
    both = [openings_of({"x": np.ones(5)}), openings_of({"y": np.ones(5)}, step="2019-12")]
    assert depth_sentences(OpeningDepths(plans, both)) == [
        "b and a have no opening in common. Only b mines y. Only a mines x. "
        "The depths of b are those after 2019-12, of a after 2019-09."
    ]
