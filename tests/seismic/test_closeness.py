"""Sizes of events at several values of closeness, and what the report tells of them."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catalogs.report.sections import section_number
from catalogs.report.sections.sizes import closeness_rows, intervals_contain, unlike
from catalogs.sources.sizes import estimate_b, log_potency
from seismic.catalog import merge
from seismic.events import CLOSENESS_TRIED, extract_events, sizes_by_closeness
from seismic.regions import CORNERS, EDGES, FACES


def test_each_choice_has_the_events_that_an_extraction_with_it_has(make_scattered_step, make_settings):
    """Two steps, one after the other; the mine's own closeness among those tried, and shorter links at it alone."""
    steps = [make_scattered_step(seed) for seed in (0, 1)]
    chosen = make_settings(method="simultaneous", closeness=0.85, least_particles=2)
    del chosen["cluster"]
    found = sizes_by_closeness(iter(steps), chosen)
    choices = list(zip(found.closeness.values, found.reach.values, strict=True))
    tried = sorted([*CLOSENESS_TRIED, 0.85])
    assert choices == [*((value, CORNERS) for value in tried), (0.85, EDGES), (0.85, FACES)]
    assert choices[found.attrs["own"]] == (0.85, CORNERS)
    numbers = []
    for index, (value, reach) in enumerate(choices):
        expected = []
        for step in steps:
            events, _ = extract_events(step, chosen | {"closeness": value}, reach)
            expected += events.potency.values[events.resolved.values == 1].tolist()
        assert expected
        assert_array_equal(found.potency.values[found.choice.values == index], expected)
        numbers.append(len(expected))
    assert len({numbers[found.attrs["own"]], *numbers[-2:]}) == 3


def test_families_have_no_links_to_shorten(make_scattered_step, make_settings):
    found = sizes_by_closeness([make_scattered_step(0)], make_settings())
    assert_array_equal(found.closeness, CLOSENESS_TRIED)
    assert_array_equal(found.reach, 0)
    rows = closeness_rows(SimpleNamespace(closeness=found), -10.0)
    assert {row["over"] for row in rows} == {""}


def test_rows_and_sentence_say_what_the_sizes_are(make_scattered_step, make_settings):
    chosen = make_settings(method="simultaneous", least_particles=1)
    del chosen["cluster"]
    found = sizes_by_closeness([make_scattered_step(0, 900)], chosen)
    evidence = SimpleNamespace(closeness=found)
    cut = float(np.median(log_potency(found.potency.values)))
    rows = closeness_rows(evidence, cut)
    assert [row["closeness"] for row in rows] == ["0.6", "0.7", "0.8", "0.9", "0.95", "0.8", "0.8"]
    assert [row["over"] for row in rows] == [*["faces, edges, corners"] * 5, "faces, edges", "faces"]
    assert [row["own"] for row in rows] == [False, False, True, False, False, False, False]
    for index in (3, 6):
        own = log_potency(found.potency.values[found.choice.values == index])
        assert rows[index]["b"] == estimate_b(own, cut).b
        assert rows[index]["events"] == str(len(own))
        assert rows[index]["largest"].replace("−", "-") == f"{own.max():.2f}"
    (sentence,) = intervals_contain(SimpleNamespace(comparison=None), rows)
    b = [row["b"] for row in rows]
    assert f"b is {min(b):.2f} to {max(b):.2f} (section {section_number('sizes')})" in sentence
    assert "events at closeness 0.8 only, not the choice of closeness, links, increments or cell size" in sentence
    assert "at a closeness of 0.6 to 0.95 and with links over faces to corners, b is" in sentence
    assert intervals_contain(SimpleNamespace(comparison=None), []) == []
    assert closeness_rows(SimpleNamespace(closeness=None), cut) == []


def test_share_of_unlike_rock(make_scattered_step, make_settings):
    """Of a catalogue: the shares of its steps, weighted by what their particles released."""
    chosen = make_settings(method="simultaneous", closeness=0.8)
    del chosen["cluster"]
    steps = [extract_events(make_scattered_step(seed, step=f"s{seed}", step_index=2), chosen)[0] for seed in (0, 1)]
    catalog = merge([step.assign_attrs(unlike_share=share) for step, share in zip(steps, (0.1, 0.5), strict=True)])
    weights = [json.loads(step.attrs["budget"])["particle_scalars"] for step in steps]
    assert weights[0] != weights[1]
    assert catalog.attrs["unlike_share"] == pytest.approx(np.average([0.1, 0.5], weights=weights))
    assert 0.0 <= catalog.attrs["at_once_share"] <= max(step.attrs["at_once_share"] for step in steps)
    assert unlike(SimpleNamespace(catalog=catalog)).startswith(f"{100 * catalog.attrs['unlike_share']:.2g} % of")
    assert unlike(SimpleNamespace(catalog=catalog.isel(event=[]))) == ""
