"""Each step in a line, and what is missing of its potency: numbers by hand."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from report_fixtures import make_page
from step_fixtures import events_of, mined_in, step

from catalogs.report.sections.steps import events_by_step, latest_and_largest, mined_volumes, step_lines, total
from catalogs.report.sections.warnings import missing_potency
from common.datasets import read_dataset
from common.event_table import ON_PLANES, read_events, write_events

pytestmark = pytest.mark.usefixtures("without_drawing")


def evidence_of(model, recorded, names: list[str], parts: list[tuple[int, str, int]], cut: float | None = -2.0):
    """A mine with these steps, one a month from January 2019 on; events count from the cut (log10 m3) on."""
    steps = [step(name, 0.0, month) for month, name in enumerate(names, 1)]
    comparison = None if cut is None else {"cut": np.float64(cut)}
    return SimpleNamespace(
        catalog=model,
        resolved=model,
        record=recorded,
        comparison=comparison,
        dated=steps,
        steps=steps,
        **mined_in(parts),
    )


def test_rock_counts_in_the_step_that_mines_it_first():
    """A stope over an earlier drive, and over half a stope of its own step; one planned over all of it."""
    parts = [(0, "a", 16), (0, "b", 64), (1, "b", 32), (1, "b", 64), (2, "b", 8), (2, "c", 8), (3, "planned", 64)]
    found = mined_volumes(SimpleNamespace(steps=[{"step": name} for name in "abc"], **mined_in(parts)))
    assert found == {"a": 2.0, "b": 6.0 + 8.0 + 1.0, "c": 0.0}


def test_missing_potency_is_each_steps_own_share():
    """3 m3 with a quarter truncated lack 1, 2 m3 with a half lack 2; a step without lacks none."""
    catalog = events_of([1.0, 2.0, 2.0, 5.0], ["a", "a", "b", "c"])
    dated = [step("a", 0.25, 1), step("b", 0.5, 2), step("c", 0.0, 3)]
    text = missing_potency(SimpleNamespace(dated=dated, steps=dated, stages=[], catalog=catalog))
    assert text.startswith("About 3.0 m³ of potency is missing from the 10.0 m³")
    assert "25 to 50 %" in text
    assert "most in b, x 0 to 2 m." in text
    assert missing_potency(SimpleNamespace(dated=dated[2:], steps=dated, stages=[], catalog=catalog)) == ""


def test_rock_too_coarse_before_the_record_is_said_without_an_estimate():
    """In the history, beside a dated step without any; and in a scene that stops at elastic equilibrium."""
    before, dated = SimpleNamespace(attrs=step("history", 0.3, 1)), [step("a", 0.0, 2)]
    text = missing_potency(SimpleNamespace(dated=dated, steps=dated, stages=[before], catalog=events_of([1.0], ["a"])))
    assert text.startswith("In the steps before the record, 30 % of the rock")
    text = missing_potency(SimpleNamespace(dated=[], steps=[], stages=[before], catalog=None))
    assert text.startswith("In the elastic stage, 30 % of the rock")


def test_each_step_stands_beside_what_was_recorded_while_it_was_mined():
    """The day on which one step ends and the next begins is the next one's; smaller events do not count."""
    model = events_of([1e-1, 1e-2, 1e-3, 1e-1], ["a", "a", "a", "b"])
    recorded = events_of([1e-2, 1e-2, 1e-3, 1e-1], days=[0.0, 30.99, 5.0, 31.0])
    lines = step_lines(evidence_of(model, recorded, ["a", "b"], [(0, "a", 40), (1, "a", 48), (2, "b", 56)]))
    assert [(line.days, line.mined) for line in lines] == [(31.0, 11.0), (28.0, 7.0)]
    assert [[side.number for side in line.sides] for line in lines] == [[2, 2], [1, 1]]
    np.testing.assert_allclose([[side.potency for side in line.sides] for line in lines], [[0.11, 0.02], [0.1, 0.1]])


def test_potency_is_also_the_magnitude_of_one_event():
    """0.1 m3 in rock of 30 GPa: 3e9 N m, and 2/3 (9.4771 - 9.1) = 0.2514; the sum of 0.2 m3 0.2007 more. A step
    without events has no magnitude."""
    model = events_of([1e-1, 1e-2, 9e-2, 1e-9], ["a", "a", "b", "c"])
    lines = step_lines(evidence_of(model, None, ["a", "b", "c"], []))
    everything = total(evidence_of(model, None, ["a", "b", "c"], []), lines)
    assert [side.largest for line in lines for side in line.sides] == pytest.approx(
        [0.2514, 0.2209, np.nan], abs=1e-4, nan_ok=True
    )
    (side,) = everything.sides
    assert (side.number, everything.name, everything.days) == (3, "all 3 steps", 90.0)
    assert [side.potency, side.as_one, side.largest] == pytest.approx([0.2, 0.2514 + 0.2007, 0.2514], abs=1e-4)


def test_of_many_steps_the_latest_and_the_largest_are_kept_in_order():
    """Largest in either catalogue: 'd' has least of the model's potency, and most of the record's."""
    names = list("abcdefg")
    model = events_of([1.0, 6.0, 2.0, 0.01, 5.0, 0.1, 0.02], names)
    recorded = events_of([9.0, 1.0], days=[95.0, 5.0])  # in d, in a
    lines = step_lines(evidence_of(model, recorded, names, []))
    assert [line.name for line in latest_and_largest(lines, 4)] == ["b", "d", "e", "g"]
    assert latest_and_largest(lines, 7) == lines
    alone = step_lines(evidence_of(model, None, names, []))
    assert [line.name for line in latest_and_largest(alone, 3)] == ["b", "e", "g"]
    silent = step_lines(evidence_of(events_of([]), None, names, []))
    assert [line.name for line in latest_and_largest(silent, 1)] == ["g"]


def test_a_record_that_ends_within_a_step_says_for_how_many_of_its_days_it_is():
    recorded = events_of([1e-2], days=[3.0])
    recorded.attrs["period"] = json.dumps({"common": ["2019-01-01T00:00:00", "2019-02-11T00:00:00"]})
    lines = step_lines(evidence_of(recorded, recorded, ["a", "b", "c"], [], cut=None))
    assert [(line.days, line.recorded_days) for line in lines] == [(31.0, 31.0), (28.0, 10.0), (31.0, 0.0)]


def test_the_largest_event_is_the_largest_potency_in_the_host_rock():
    """As on the page of plans: the moment of the event's own rock does not count."""
    model = events_of([1e-1, 1e-2], ["a", "a"])
    model["mw"][:] = [0.1, 0.9]
    (line,) = step_lines(evidence_of(model, None, ["a"], []))
    assert line.sides[0].largest == pytest.approx(0.2514, abs=1e-4)


def test_headline_counts_the_events_of_the_catalogue(page, mine):
    """150 events; how many in each step is counted anew here."""
    step = list(read_dataset(mine.catalog)["step"].values)
    expected = f"150 events in 2 dated steps: {step.count('2019-08')} in 2019-08, {step.count('2019-09')} in 2019-09."
    assert expected in page.sections["steps"]


def test_headline_tells_of_events_on_weak_planes(page, mine, tmp_path):
    """Half of the events slipped on planes wholly, the others not at all; without planes not a word."""
    catalog = read_events(mine.catalog)
    share = np.arange(150) % 2.0
    write_events(catalog.assign(on_planes=("event", share, ON_PLANES.attributes)), tmp_path / "catalog.nc")
    potency = catalog["potency"].values
    percent = 100 * potency[1::2].sum() / potency.sum()
    expected = f"75 events slipped mostly on weak planes: {percent:.0f} %"
    assert expected in make_page(mine, tmp_path, catalog=tmp_path / "catalog.nc").sections["steps"]
    assert "weak planes" not in page.sections["steps"]


def test_events_of_many_steps_are_told_by_those_with_most():
    """In order of time; of few steps each is told."""
    counts = [(number % 7 * 10, f"m{number}") for number in range(30)]
    told = events_by_step(counts)
    assert told.startswith("most in these, ")
    entries = told.removeprefix("most in these, ").split(", ")
    assert len(entries) <= 5
    assert {entry.split(" in ")[0] for entry in entries} <= {"60", "50"}
    assert "60 in m6" in entries
    assert events_by_step(counts[:3]) == "0 in m0, 10 in m1, 20 in m2"
