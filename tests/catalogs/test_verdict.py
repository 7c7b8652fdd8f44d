"""The first page in words: what the model says, how sure that is, what to do; each state of a mine in its words."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from report_fixtures import compared, dated_steps, said

from catalogs.compare.comparison import compare
from catalogs.report.evidence import Evidence
from catalogs.report.first_page import MAX_NEXT, next_steps
from catalogs.report.sections.warnings import Advice, Banner, banners
from catalogs.report.text import as_ratio
from catalogs.report.uncertainty import sources
from catalogs.report.verdict import BLIND, RANDOM_TURN, RARE_TURN, TESTS, verdict
from catalogs.sources.mechanisms import kagan_angle, random_frames
from catalogs.sources.size_law import POWER

TEST_VALUES = [*(f"{name}_p_value" for name in TESTS), "mechanism_turn_random_p_value"]


def advised(evidence: Evidence) -> list[str]:
    return [one.code for one in next_steps(evidence, banners(evidence), sources(evidence))]


# ---- what the model says ----


@pytest.mark.parametrize(
    ("value", "text"), [(1.234, "1.2"), (29.0, "29"), (0.43, "0.43"), (0.2, "0.20"), (1 / 29, "1/29"), (0.0, "0")]
)
def test_ratios_are_said_as_people_say_them(value, text):
    assert as_ratio(value) == text


@pytest.mark.parametrize(
    ("ratio", "interval", "chance", "words"),
    [
        (1 / 29, (1 / 60, 1 / 12), 0.001, "releases 1/29 of the recorded potency (95 %: 1/60 to 1/12), in"),
        (1 / 29, (1 / 60, 1 / 12), 0.001, "The difference in potency is more than chance explains, and that in number"),
        (0.5, (0.3, 0.9), 0.03, "Both differences are no more than chance explains."),
        (4.0, (1.5, np.inf), 0.001, "releases 4.0 times the recorded potency (95 %: 1.5 or more), in"),
        (1.2, (0.703, 2.11), 0.5, "releases 1.2 times the recorded potency (95 %: 0.70 to 2.2), in"),
        (1.2, (0.7, 2.1), 0.5, "Both differences are no more than chance explains."),
        (0.5, (0.3, 0.996), 0.04, "(95 %: 0.300 to 0.996), in"),  # it excludes 1, and looks so
    ],
)
def test_the_ratio_of_potencies_is_a_sentence_and_a_test(known, ratio, interval, chance, words):
    one = compared(
        known, potency_ratio=ratio, potency_ratio_interval=interval, potency_ratio_p_value=chance, event_ratio=1.0,
        event_ratio_interval=(0.5, 2.0), event_ratio_p_value=0.9,
    )  # fmt: skip
    assert words in verdict(one)[0]
    assert verdict(one)[0].startswith("The model releases ")
    assert verdict(compared(one, model_runs=9))[0].startswith("The mean of 9 runs of the model releases ")


@pytest.mark.parametrize(
    ("ratio", "counts", "without", "words"),
    [
        (1 / 1381, (50, 3), (1 / 2000, 1 / 40), "3 events hold 90 % of the recorded potency; without them the ratio is "
         "1/40. "),
        (1381.0, (1, 9), (3.0, 2000.0), "One event holds 90 % of the modelled potency; without it the ratio is 3.0. "),
        (1 / 1381, (50, 30), (1 / 2000, 1 / 40), ""),  # many events hold it
        (1 / 1381, (50, 2), (1 / 2000, np.nan), ""),  # there are no others
    ],
)  # fmt: skip
def test_few_events_that_potency_rests_on_are_counted(known, ratio, counts, without, words):
    one = compared(known, potency_ratio=ratio, large_events=counts, potency_ratio_without_large=without)
    assert words in verdict(one)[0]
    several = words.replace("One event holds", "One event of all runs holds") if ratio > 1.0 else words
    assert several in verdict(compared(one, model_runs=9))[0]
    assert ("90 % of the" in verdict(one)[0]) == bool(words)


def test_potency_of_all_sizes_is_said_where_most_of_it_is_in_events_too_small_to_compare(known):
    """As where the model's cells are large: above the cut it has too much, in all just as much."""
    off = {"potency_ratio": 4.0, "potency_ratio_interval": (1.5, 9.0), "potency_ratio_all": 0.9}
    one = compared(known, summed_potency=(400.0, 100.0), summed_potency_all=(450.0, 500.0), **off)
    first, second = verdict(one)[:2]
    assert re.match(r"Of events of Mw [−\d.]+ and more, the model releases 4.0 times the recorded potency", first)
    assert second == (
        "Smaller events hold 80 % of the recorded potency. Of all sizes the model releases 0.90 times the recorded "
        "potency."
    )
    most = compared(one, summed_potency=(400.0, 300.0))
    assert verdict(most)[0].startswith("The model releases 4.0 times")
    assert "Smaller events" not in " ".join(verdict(most))


def test_number_is_judged_apart_from_potency(known):
    one = compared(
        known, potency_ratio_p_value=0.3, event_ratio=0.1, event_ratio_interval=(0.05, 0.3), event_ratio_p_value=0.002
    )
    text = verdict(one)[0]
    assert "in 1/10 of the recorded number of events (95 %: 1/20 to 0.30). " in text
    assert text.endswith(
        "The difference in potency is no more than chance explains, and that in number is more than chance explains."
    )


@pytest.mark.parametrize(
    ("chance", "words"),
    [
        (0.3, "Their places differ by no more than chance explains."),
        (0.02, "Their places differ by no more than chance explains."),
        (0.004, "Their places differ by more than chance explains."),
    ],
)
def test_places_are_judged_by_their_test_alone(known, chance, words):
    """However far events are from the nearest of the record, and whatever its location error is."""
    one = compared(
        known, energy_p_value=chance, centroid_distance=12.0, centroid_distance_interval=(0.0, 24.4),
        nearest_distance=(90.0, 90.0, 3.0), location_error=1.0,
    )  # fmt: skip
    assert f"is 12 m from that of recorded ones (95 %: 0 to 25 m). {words}" in said(one)
    assert "whether places agree" in said(compared(one, energy_p_value=np.nan))


@pytest.mark.parametrize(
    ("chance", "at_random", "words"),
    [
        (0.4, 0.01, ": the same direction, as far as chance tells, and closer than random ones come."),
        (0.002, 0.01, ", which is more than chance explains, though closer than random directions come."),
        (0.03, 0.1, ": so few events tell neither a different direction nor one closer than random ones come."),
        (0.002, 0.1, ", which is more than chance explains, and no closer than random directions come."),
        (0.4, 0.1, ": so few events tell neither a different direction nor one closer than random ones come."),
    ],
)
def test_directions_are_tested_against_the_record_and_against_chance(known, chance, at_random, words):
    one = compared(
        known, mechanism_turn=44.6, mechanism_turn_interval=(20.2, 69.1), mechanism_turn_p_value=chance,
        mechanism_turn_random_p_value=at_random,
    )  # fmt: skip
    text = (
        "On average its rock slips in a direction 45° off the recorded one (95 %: 20 to 70°; a random direction is off"
    )
    assert text in said(one)
    assert words in said(one)


def test_angles_of_random_mechanisms_are_those_that_the_page_states():
    angle = kagan_angle(random_frames(100_000, np.random.default_rng(1)), np.eye(3))
    assert (angle.mean(), np.quantile(angle, 0.05)) == pytest.approx((RANDOM_TURN, RARE_TURN), abs=0.5)


def test_the_page_states_what_it_would_have_noticed(known):
    one = compared(
        known, event_ratio_noticed=1 / 7, potency_ratio_noticed=np.inf, b_difference_noticed=0.311,
        shift_noticed=24.2, mechanism_turn_noticed=20.1, energy_distance_interval=(1.0, 2.0),
        **dict.fromkeys(TEST_VALUES, 0.5),
    )  # fmt: skip
    text = said(one)
    assert (
        "In 4 of 5 cases the tests would have noticed 1/7.0 of the number of events, 0.31 more in b, a shift of 24 m "
        "or a turn of 20°. They could not have noticed too much potency: events, or clusters of them, are too few. At "
        "most one right model in 20 fails one of these 5 tests."
    ) in text
    assert "other runs of the model" not in text
    alone = compared(one, energy_distance_interval=(np.nan, np.nan))
    assert "How far other runs of the model would differ is taken from the record." in said(alone)


def test_only_tests_that_were_made_are_counted(known):
    made = compared(known, **dict.fromkeys(TEST_VALUES, 0.5), event_ratio_noticed=3.0)
    none = {"axes_present": 0, "mechanism_turn_p_value": np.nan, "mechanism_turn_random_p_value": np.nan}
    few = said(compared(made, **none, b_difference_p_value=np.nan))
    assert "At most one right model in 33 fails one of these 3 tests." in few
    assert "That against random directions" not in few


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("shift", 950.0, "a shift of 950 m"),
        ("shift", 1200.0, "The tests could not have noticed other places"),
        ("b_difference", 0.31, "0.31 more in b"),
        ("b_difference", 5.0, "The tests could not have noticed another b"),
        ("mechanism_turn", 130.0, "The tests could not have noticed another direction"),
        ("potency_ratio", 950.0, "950 times the potency"),
        ("potency_ratio", 1 / 1200, "The tests could not have noticed too little potency"),
    ],
)
def test_each_kind_of_difference_has_its_own_limit_of_what_is_noticed(known, name, value, words):
    others = {f"{one}_noticed": np.nan for one in BLIND}
    text = said(compared(known, **others | {f"{name}_noticed": value}))
    assert re.search(rf"{words}[.:, ]", text)
    assert ("would have noticed" in text) != words.startswith("The tests could not")


@pytest.mark.parametrize(
    ("b", "chance", "words"),
    [
        ((0.9, 0.6), 0.002, "Its b of potency, 0.90, is higher than the recorded one, 0.60, by more than chance"),
        ((0.5, 0.6), 0.03, "0.50, is lower than the recorded one, 0.60, by no more than chance explains."),
        ((0.601, 0.602), 0.9, "0.601, is lower than the recorded one, 0.602, by no more than chance explains."),
    ],
)
def test_b_is_compared_by_itself(known, b, chance, words):
    """With an end of the sizes a higher b may go with more large events, so nothing is said of those."""
    one = compared(known, b=b, b_difference_p_value=chance, law_model=POWER, law_record=POWER)
    assert words in said(one)
    assert "large than" not in said(one)


def test_a_record_without_mechanisms_says_nothing_of_directions(known):
    record = known.record.copy(deep=True)
    record["p_axis"][:] = np.nan
    text = said(replace(compared(known, axes_present=0), record=record))
    assert "in which direction rock moved (the record has no mechanisms)" in text
    assert "slips in a direction" not in text
    assert "mechanisms" not in said(compared(known, axes_present=0))  # it has some, too few to compare


def test_without_a_record_nothing_is_checked(known):
    one = replace(known, record=None, comparison=None)
    first, *others = verdict(one)
    assert first == "There is no record: nothing here is checked against events that happened."
    assert "of the potency is nearest to stope_2." in others[0]
    assert advised(one)[0] == "record"


@pytest.mark.parametrize(
    ("counts", "p_value", "words"),
    [
        ((12, 0), 0.001, "The model makes events where the record has none, which is more than chance explains."),
        ((2, 0), 0.4, "The model makes events where the record has none, which is no more than chance explains."),
        ((0, 9), 0.001, "The record has events where the model makes none, which is more than chance explains."),
        (
            (0, 0),
            np.nan,
            "Neither the model nor the record has an event of a size that counts: nothing can be compared.",
        ),
    ],
)
def test_one_catalogue_without_events(known, counts, p_value, words):
    one = compared(known, events_above_cut=counts, event_ratio_p_value=p_value, law_model="too few events")
    assert verdict(one)[0] == words
    assert "snakemake calibrate" not in advised(one) or counts[1]


def test_a_single_recorded_event_is_compared_in_potency_only(known):
    record = known.record.isel(event=slice(0, 1))
    catalog = known.catalog
    one = replace(known, record=record, comparison=compare(catalog, record, dated_steps()))
    assert "of the recorded potency" in said(one) or "times the recorded potency" in said(one)
    assert "Their places" not in said(one)
    assert "nan" not in said(one)


def test_mines_without_steps_dates_or_events(known):
    """Each says so first, and what would change it; nothing is uncertain where there is nothing."""
    nothing = dict.fromkeys(("catalog", "record", "comparison"))
    elastic = replace(known, stages=known.stages[:1], **nothing)
    assert verdict(elastic)[0].startswith("This scene has no mining steps")
    assert advised(elastic)[0] == "steps"
    undated = [stage.copy() for stage in known.stages]
    for stage in undated:
        stage.attrs["dated"] = 0
    config = known.config | {"record": {"file": "record.csv"}}
    no_dates = replace(known, stages=undated, config=config, **nothing)
    assert verdict(no_dates)[1] == "The record is not compared, since no step of this mine has dates."
    assert advised(no_dates) == ["steps: start, end"]
    silent = replace(known, catalog=known.catalog.isel(event=slice(0)), record=None, comparison=None)
    assert verdict(silent)[0].startswith("The model made no events in its 2 dated steps")
    assert "insitu_stress, materials" in advised(silent)
    for one in (elastic, no_dates, silent):
        assert sources(one) == []


# ---- what makes it uncertain ----


def convergence(evidence: Evidence, error: float, thickness: float = 2.0) -> Evidence:
    """A second run on cells of twice the size, and the uncertainty that cells leave."""
    numbers = np.array([[5.0], [4.0]])
    table = {name: (("cell", "period"), numbers) for name in ("potency", "failed_volume")}
    table |= {f"{name}_error": ("period", [error]) for name in ("potency", "failed_volume")}
    table |= {"thickness": (("cell", "period"), [[thickness], [0.5 * thickness]])}
    return replace(evidence, grid_convergence=xr.Dataset(table, {"cell": [4.0, 8.0], "period": ["all"]}))


def ensemble(evidence: Evidence, mean: float, deviation: float, members: int = 8) -> Evidence:
    statistics = np.array([[mean, deviation, 0.0, 0.0]])
    runs = xr.Dataset({"potency_statistics": (("period", "statistic"), statistics)}, {"period": ["all"]})
    return replace(evidence, spread=runs.assign_attrs(members=members))


def by_name(evidence: Evidence) -> dict:
    return {one.name: one for one in sources(evidence)}


def test_sources_stand_by_size_and_those_not_measured_last(known):
    """Record: 3 of 1 and 0.5; cells 25 %; chance 2 x 0.2; increments 12 % as the steps have it."""
    one = compared(
        ensemble(convergence(known, 0.25), 10.0, 2.0), potency_rate=[1.0, 1.0], potency_rate_interval=(0.5, 3.0)
    )
    found = sources(one)
    assert [source.name for source in found] == [
        "The record", "Chance in the model", "Cells", "Increments of mining",
        "Rock properties and stress",
    ]  # fmt: skip
    assert [source.factor for source in found] == pytest.approx([3.0, 1.4, 1.25, 1.12, np.nan], nan_ok=True)
    assert "within a factor of 1.4 between 8 equally valid runs" in found[1].text
    assert "within a factor of 1.2: failed rock is 2.0 cells thick (volume over surface)" in found[2].text
    bare = sources(replace(known, record=None, comparison=None))
    assert [source.name for source in bare] == [
        "Increments of mining", "Cells", "Chance in the model", "Rock properties and stress",
    ]  # fmt: skip
    assert all(source.text.startswith("not measured") for source in bare[1:3])


@pytest.mark.parametrize(("interval", "factor"), [((0.2, 3.0), 10.0), ((1.0, 8.0), 4.0)])
def test_the_record_is_as_uncertain_as_the_farther_end_of_its_interval(known, interval, factor):
    one = compared(known, potency_rate=[1.0, 2.0], potency_rate_interval=interval)
    assert by_name(one)["The record"].factor == pytest.approx(factor)


@pytest.mark.parametrize(("thickness", "why"), [(0.3, "only 0.30 cells of 4 m thick"), (5.0, "changes too much from")])
def test_an_error_too_large_for_a_factor_stands_first_and_forbids_the_numbers(known, thickness, why):
    """Since failed rock is thin, or since the change from doubled cells is large where it is thick."""
    one = convergence(known, 0.9, thickness)
    first = sources(one)[0]
    assert (first.name, first.factor) == ("Cells", np.inf)
    worst = banners(one)[0]
    assert worst.invalid
    assert worst.brief == "cells of 4 m are too large to say how far potency would still change"
    assert why in worst.text
    assert "Do not use these numbers before grid.finest_cell is halved." in worst.text
    assert advised(one)[0] == "grid.finest_cell: 2 m"


def test_too_few_members_measure_no_chance(known):
    source = by_name(ensemble(known, 10.0, 2.0, members=2))["Chance in the model"]
    assert np.isnan(source.factor)
    assert source.advice.code == "ensemble: 8"


def test_increments_are_made_smaller_by_the_key_that_sets_them(known):
    codes = {
        by_name(replace(known, config=known.config | {"solver": solver}))["Increments of mining"].advice.code
        for solver in ({"increments": 4}, {"increments": 0, "max_overshoot": 0.2})
    }
    assert codes == {"solver.increments: 8", "solver.max_overshoot: 0.1"}


# ---- what to do next ----


def test_what_is_wrong_is_mended_first_and_at_most_three_are_told(known):
    draft = Banner("draft", "", "this is a draft", Advice("Compute the mine without", "accuracy: draft"), invalid=True)
    found = next_steps(known, [draft], sources(known))
    assert [one.code for one in found] == ["accuracy: draft", "grid_convergence: true", "ensemble: 8"]
    assert len(found) == MAX_NEXT


def test_a_potency_that_is_off_is_calibrated(known):
    off = compared(known, potency_ratio=0.1, potency_ratio_p_value=0.001)
    first = next_steps(off, [], sources(off))[0]
    assert (first.code, "calibration:" in first.text) == ("snakemake calibrate", True)
    named = replace(off, config=off.config | {"calibration": {"quantities": [{"key": "a"}]}})
    assert "calibration" not in next_steps(named, [], sources(named))[0].text
    fits = compared(known, potency_ratio_p_value=0.3, event_ratio_p_value=0.02)
    assert "snakemake calibrate" not in advised(fits)


def test_a_silent_record_is_nothing_to_calibrate_to(known):
    """Its ratio of numbers differs from 1 by more than chance, too."""
    silent = compared(known, events_above_cut=(90, 0), event_ratio_p_value=0.001)
    assert "snakemake calibrate" not in advised(silent)
    assert "snakemake calibrate" in advised(compared(silent, events_above_cut=(90, 1)))


def test_what_was_never_measured_is_measured_before_anything_is_refined(known):
    one = compared(convergence(known, 0.25), potency_ratio_p_value=0.5, event_ratio_p_value=0.5)
    assert advised(one)[:2] == ["ensemble: 8", "grid.finest_cell: 2 m"]


def test_where_all_is_measured_the_largest_is_made_smaller_and_plans_follow(known):
    measured = ensemble(convergence(known, 0.25), 10.0, 0.5)
    measured = compared(measured, potency_ratio_p_value=0.5, event_ratio_p_value=0.5)
    assert advised(measured) == ["grid.finest_cell: 2 m", "excavations.stope_9.step"]
    plans = replace(measured, config=measured.config | {"plans": {"slower": {}}})
    assert advised(plans)[1:] == ["snakemake plans", "excavations.stope_9.step"]
    levels = replace(measured, config=measured.config | {"grid": {"coarse_cell": "16 m", "levels": 3}})
    assert advised(levels)[0] == "grid.levels: 4"
    unlocated = replace(measured, record=measured.record.assign_attrs(location_error=0.0))
    assert advised(unlocated)[1] == "record.location_error"


def test_a_twin_is_to_be_replaced_by_what_was_measured(known):
    twin = replace(known, record=known.record.assign_attrs(kind="twin"))
    assert "record" in advised(twin)
    assert "record" not in advised(known)


# ---- warnings ----


def test_every_warning_of_the_first_page_is_short_and_has_a_remedy(known):
    """All that can be wrong, at once."""
    grid = known.grid.copy()
    solid = np.array(json.loads(grid.attrs["excavation_volume"]))
    grid.attrs |= {
        "excavation_volume_grid": json.dumps((1.3 * solid).tolist()),
        "excavation_narrow": grid.attrs["excavation_names"],
        "excavation_cells_across": json.dumps([1.2] * 4),
        "excavation_cells_needed": json.dumps([4] * 4),
        "excavation_open_share": json.dumps([0.2] * 4),
    }
    stages = [stage.copy() for stage in known.stages]
    stages[-1].attrs |= {
        "truncated": 1, "truncated_share": 0.6, "loose_pieces": 2, "loose_volume": 99.0, "loose_where": "x",
        "boundary_failed_faces": "z_lower", "boundary_failed_volume": 8.0,
    }  # fmt: skip
    config = known.config | {"accuracy": "draft"}
    wrong = replace(convergence(known, 5.0, 1.0), grid=grid, stages=stages, config=config)
    brief = [one for one in banners(wrong) if one.brief]
    assert len(brief) == 8
    assert [one.invalid for one in brief] == sorted((one.invalid for one in brief), reverse=True)
    assert sum(one.invalid for one in brief) == 3  # a draft, cells too large, most rock too coarse to fail
    for one in brief:
        assert len(one.brief) < 100, one.brief
        assert one.mend is not None, one.brief
        assert not one.brief[0].isupper(), one.brief
        assert not one.brief.endswith("."), one.brief
    assert not [one for one in banners(known) if one.brief]


def test_falls_and_collapse_are_named_with_volume_opening_and_step(known):
    def with_attributes(**attributes):
        stages = [stage.copy() for stage in known.stages]
        stages[-1].attrs |= attributes
        return replace(known, stages=stages)

    pieces = [
        {"fall": 1, "volume": 227.0, "place": {"x": 1.0, "y": 2.0, "z": 3.0}, "opening": "drive", "side": "back"},
        {"fall": 2, "volume": 3.0, "place": {"x": 5.0, "y": 2.0, "z": 3.0}, "opening": "drive", "side": "wall"},
    ]
    (fall,) = [one for one in banners(with_attributes(falls=json.dumps(pieces))) if one.brief]
    step = known.stages[-1].attrs["step"]
    assert fall.brief == f"230 m³ fell in {step}, most of it from the back of drive"
    assert f"Rock fell in step {step}: 230 m³ in 2 falls: 227 m³ from the back of drive at (x, y, z)" in fall.text
    assert not fall.invalid
    (lost,) = [one for one in banners(with_attributes(collapsed=1, collapse="rock moved")) if one.brief]
    assert lost.invalid
    assert f"Rock found no equilibrium in step {step}: rock moved" in lost.text
